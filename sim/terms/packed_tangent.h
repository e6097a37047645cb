// Tangent blocks of a prism in packs of points, for laws that give the derivatives of a step in closed form
// (skin_tangent.h): what PointKernel's version does by dual numbers, one point at a time. What a point needs is found once
// for all directions of a call.
//
// A law supplies     num_tangent_constants, tangent_constants(θ, dt, c)   numbers of the step
//                    has_lookback()     whether what is prepared depends on the old strain
//                    tangent_at(point)  what the step's derivatives need at a pack of points (TangentPoint), with
//                      to_old, to_now                    X⁻ᵀ: directions of Y are given as X⁻¹ dY X⁻ᵀ
//                      prepared(dy_old, ds_old, dθ, p)   p: d(prepared) in some form of its own
//                      stress(p, dθ, dσ)                 at fixed strain; what multiplies X⁻¹ dY X⁻ᵀ
//                      update(p, dy, dθ, ds_new)
//                      and their transposes (packed_adjoint.h)
//
// Shapes   as in point_kernel.h.
// Tests    tests/sim/terms/tangent_kernel_test.cpp, term_kernels_test.cpp
#pragma once

#include "sim/terms/packed_sums.h"
#include "sim/terms/skin_tangent.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Derivatives of nodal values [n][3][kDirections] direction by direction, and back.
class NodalDirections {
 public:
  explicit NodalDirections(int num_nodes) : rows_(3 * num_nodes) {}
  /// [n][3]
  double* operator[](int direction) { return values_[direction]; }

  void load(const double* du) {
    for_blocks([&](int row, int count, int first) __attribute__((always_inline)) {
      Lanes m[kLanes];
      for (int k = 0; k < kLanes; ++k)
        m[k] = load_lanes(du + (row + (k < count ? k : 0)) * kDirections + first);
      transpose(m);
      for (int k = 0; k < kLanes; ++k) store_lanes(m[k], values_[first + k] + row);
    });
  }
  void clear() {
    for (double(&values)[kStride] : values_)
      std::memset(values, 0, sizeof(double) * static_cast<std::size_t>(rows_));
  }
  void add_to(double* df) const {
    for_blocks([&](int row, int count, int first) __attribute__((always_inline)) {
      Lanes m[kLanes];
      for (int k = 0; k < kLanes; ++k) m[k] = load_lanes(values_[first + k] + row);
      transpose(m);
      for (int k = 0; k < count; ++k) {
        double* const to = df + (row + k) * kDirections + first;
        store_lanes(load_lanes(to) + m[k], to);
      }
    });
  }

 private:
  static constexpr int kStride = 3 * kMaxElementNodes + 8;

  /// f(first row, rows, first direction) for squares of rows and directions.
  template <class F>
  void for_blocks(F&& f) const {
    for (int row = 0; row < rows_; row += kLanes)
      for (int first = 0; first < kDirections; first += kLanes)
        f(row, rows_ - row < kLanes ? rows_ - row : kLanes, first);
  }

  int rows_;
  alignas(8 * kLanes) double values_[kDirections][kStride];
};

/// Derivatives [nq][count][kDirections] at the points of a pack, out[direction][component].
template <int count>
void load_point_directions(const double* values, const int* points, Lanes (*out)[count]) {
  for (int c = 0; c < count; ++c)
    for (int first = 0; first < kDirections; first += kLanes) {
      Lanes m[kLanes];
      for (int k = 0; k < kLanes; ++k)
        m[k] = load_lanes(values + (points[k] * count + c) * kDirections + first);
      transpose(m);
      for (int k = 0; k < kLanes; ++k) out[first + k][c] = m[k];
    }
}
/// The same back, for the first `num` points.
template <int count>
void store_point_directions(const Lanes (*in)[count], const int* points, int num, double* values) {
  for (int c = 0; c < count; ++c)
    for (int first = 0; first < kDirections; first += kLanes) {
      Lanes m[kLanes];
      for (int k = 0; k < kLanes; ++k) m[k] = in[first + k][c];
      transpose(m);
      for (int k = 0; k < num; ++k) store_lanes(m[k], values + (points[k] * count + c) * kDirections + first);
    }
}

/// A step of a law at a pack of points; past the element's end the last point is repeated with weight 0.
template <class Law, class Kin>
struct PackedStep {
  static constexpr int ne = Law::ne, nz = Kin::nz, ns = Law::ns, np = Law::np, nt = Law::ntheta;
  static_assert(ne == 6 && nz == 9, "prisms only");
  static constexpr int at_least_one(int n) { return n > 0 ? n : 1; }
  using Parameters = PackedParameters<nt, Law::num_tangent_constants>;
  using Natural = double[nz][kMaxPacked];

  const int* points;
  int count;  ///< of them inside the element
  Lanes weight, jacobian[9], h[nz], y[ne], h_old[nz], y_old[ne], history[at_least_one(ns)],
      prepared[at_least_one(np)];

  /// `natural_old` may be null: then there is no old strain, and the history is not read.
  PackedStep(const ElementView& v, const int* all_points, int first, const Natural& natural,
             const Natural* natural_old, const double* s_old, const double* prepared_all)
      : points(all_points + first),
        count(v.num_points - first < kLanes ? v.num_points - first : kLanes),
        weight(make_lanes([&](int k) { return k < count ? v.weight[points[k]] : 0.0; })) {
    load_points<9>(v.inverse_jacobian, points, jacobian);
    gradient(natural, first, h);
    Kin::strain(h, y);
    if constexpr (np > 0) load_points<np>(prepared_all, points, prepared);
    if (!natural_old) return;
    gradient(*natural_old, first, h_old);
    Kin::strain(h_old, y_old);
    if constexpr (ns > 0) load_points<ns>(s_old, points, history);
  }
  /// The law's derivatives here.
  auto derivatives(const Law& law, const Parameters& own, bool start, bool stress, bool update,
                   bool parameters) const {
    return law.template tangent_at<Lanes>(
        {y, y_old, history, prepared, own.theta, own.constants, start, stress, update, parameters});
  }

 private:
  void gradient(const Natural& natural, int first, Lanes* z) const {
    Lanes local[nz];
    for (int i = 0; i < nz; ++i) local[i] = load_lanes(natural[i] + first);
    Kin::to_point(local, jacobian, z);
  }
};

/// out = T z, z the numbers at `first` of rows.
template <int n, int nz>
[[gnu::always_inline]] inline void multiply_rows(const Lanes (*t)[nz], const double (*rows)[kMaxPacked],
                                                 int first, Lanes* out) {
  Lanes z[nz];
  for (int i = 0; i < nz; ++i) z[i] = load_lanes(rows[i] + first);
  for (int c = 0; c < n; ++c) {
    Lanes sum = t[c][0] * z[0];
    for (int i = 1; i < nz; ++i) sum += t[c][i] * z[i];
    out[c] = sum;
  }
}
/// The transpose, times a factor: writes the rows.
template <int n, int nz>
[[gnu::always_inline]] inline void multiply_rows_transposed(const Lanes (*t)[nz], const Lanes* in,
                                                            const Lanes& factor, int first,
                                                            double (*rows)[kMaxPacked]) {
  for (int i = 0; i < nz; ++i) {
    Lanes sum = t[0][i] * in[0];
    for (int c = 1; c < n; ++c) sum += t[c][i] * in[c];
    store_lanes(factor * sum, rows[i] + first);
  }
}

/// Tangent blocks of a law on prisms; pointers and shapes as in PointKernel::tangent.
template <class Law, class Kin>
struct PackedTangent {
  using Step = PackedStep<Law, Kin>;
  static constexpr int ne = Step::ne, nz = Step::nz, ns = Step::ns, np = Step::np, nt = Step::nt;
  static_assert(kDirections % kLanes == 0);

  static void tangent(const Law& law, const ElementView& v, const double* u, const double* u_old,
                      const double* s_old, const double* prepared, const double* du, const double* du_old,
                      const double* ds_old, const double* dtheta, double* df, double* ds_new) {
    if constexpr (ns == 0)
      if (!df || !dtheta) return;  // nothing else is felt
    const bool has_old = np > 0, by_old = has_old && law.has_lookback() && du_old,
               by_new = ns > 0 && ds_new && du;
    NodalDirections nodal(v.num_nodes);
    Fields now, old;
    PackedSums sums(v);
    sums.gather(u, now.value);
    if (has_old) sums.gather(u_old, old.value);
    if (by_old) old.gather(sums, nodal, du_old);
    if (by_new) now.gather(sums, nodal, du);
    const auto constants = [&](const double* theta, double* c) { law.tangent_constants(theta, v.dt, c); };
    typename Step::Parameters shared(v, constants);
    for (int first = 0; first < v.num_points; first += kLanes) {
      const Step p(v, sums.points(), first, now.value, has_old ? &old.value : nullptr, s_old, prepared);
      Lanes ds[kDirections][Step::at_least_one(ns)] = {}, dth[kDirections][nt] = {}, dy_old[ne] = {},
            dy[ne] = {}, dp[ne];
      if constexpr (ns > 0)
        if (ds_old) load_point_directions<ns>(ds_old, p.points, ds);
      if (dtheta) load_point_directions<nt>(dtheta, p.points, dth);
      if (v.theta_stride != 0) shared = typename Step::Parameters(v, p.points, constants);
      const auto at = p.derivatives(law, shared, has_old, df != nullptr, ns > 0 && ds_new, any(dth));
      Lanes to_old[ne][nz], to_now[ne][nz];
      if (by_old) Kin::strain_direction_in(at.to_old, p.h_old, p.jacobian, to_old);
      if (df || by_new) Kin::strain_direction_in(at.to_now, p.h, p.jacobian, to_now);
      for (int d = 0; d < kDirections; ++d) {
        if (by_old) multiply_rows<ne, nz>(to_old, old.along[d], first, dy_old);
        at.prepared(dy_old, ds[d], dth[d], dp);
        if (df) {
          Lanes dsigma[ne];
          at.stress(dp, dth[d], dsigma);
          multiply_rows_transposed<ne, nz>(to_now, dsigma, p.weight, first, old.along[d]);
        }
        if constexpr (ns > 0) {
          if (!ds_new) continue;
          if (by_new) multiply_rows<ne, nz>(to_now, now.along[d], first, dy);
          at.update(dp, dy, dth[d], ds[d]);
        }
      }
      if constexpr (ns > 0)
        if (ds_new) store_point_directions<ns>(ds, p.points, p.count, ds_new);
    }
    if (!df) return;
    nodal.clear();
    for (int d = 0; d < kDirections; ++d) sums.scatter(old.along[d], nodal[d]);
    nodal.add_to(df);
  }

 private:
  /// A displacement's sums at the points and those along directions, in natural directions.
  struct Fields {
    alignas(8 * kLanes) double value[nz][kMaxPacked];
    alignas(8 * kLanes) double along[kDirections][nz][kMaxPacked];

    void gather(PackedSums& sums, NodalDirections& nodal, const double* du) {
      nodal.load(du);
      for (int d = 0; d < kDirections; ++d) sums.gather(nodal[d], along[d]);
    }
  };

  static bool any(const Lanes (*directions)[nt]) {
    LaneMask nonzero = {};
    for (int d = 0; d < kDirections; ++d)
      for (int c = 0; c < nt; ++c) nonzero |= directions[d][c] != 0.0;
    return any_of(nonzero);
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
