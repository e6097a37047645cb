// Adjoint blocks of a prism in packs of points, by reverse-mode numbers: what PointKernel's versions do by dual
// numbers, one point at a time, for a fraction of the price (a law is recorded once instead of being carried
// along in as many directions as it has inputs). Knows no physics either.
//
// Shapes   as in point_kernel.h.
// Tests    tests/sim/terms/term_kernels_test.cpp, reverse_kernel_test.cpp
#pragma once

#include <cstring>
#include <type_traits>

#include "sim/math/reverse.h"
#include "sim/terms/element_sums.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Adjoint blocks of a law on prisms; pointers and shapes as in PointKernel, whose functions these stand in for.
template <class Law, class Kin>
struct ReverseKernel {
  static constexpr int ne = Law::ne, nz = Kin::nz, ns = Law::ns, np = Law::np, nt = Law::ntheta;
  static_assert(ne == 6 && nz == 9, "prisms only");
  static constexpr int at_least_one(int n) { return n > 0 ? n : 1; }
  /// A pack of points, or one where a law reads rest data, which differ from point to point.
  using V = std::conditional_t<Law::nrest == 0, Lanes, double>;
  static constexpr int width = static_cast<int>(sizeof(V) / sizeof(double));
  using Number = Reverse<V>;
  using Tape = ReverseTape<V>;

  /// Points first … first + width − 1; past the element's end the last point is repeated.
  struct Pack {
    const ElementView& v;
    int count;         ///< of them inside the element
    int point[width];  ///< index of each

    Pack(const ElementView& view, int start)
        : v(view), count(v.num_points - start < width ? v.num_points - start : width) {
      for (int k = 0; k < width; ++k) point[k] = start + (k < count ? k : count - 1);
    }
    /// Component c of per-point data [nq][stride]; stride 0: the same at all points.
    V load(const double* values, int stride, int c) const {
      double numbers[width];
      for (int k = 0; k < width; ++k) numbers[k] = values[point[k] * stride + c];
      V lanes;
      std::memcpy(&lanes, numbers, sizeof lanes);
      return lanes;
    }
    void store(const V& lanes, double* values, int stride, int c) const {
      double numbers[width];
      std::memcpy(numbers, &lanes, sizeof lanes);
      for (int k = 0; k < count; ++k) values[point[k] * stride + c] = numbers[k];
    }
    void load_theta(Number* theta, bool inputs) const {
      for (int c = 0; c < nt; ++c) {
        const V value = load(v.theta, v.theta_stride, c);
        theta[c] = inputs ? Number::input(value) : Number::constant(value);
      }
    }
    void load_jacobian(V* jacobian) const {
      for (int i = 0; i < 9; ++i) jacobian[i] = load(v.inverse_jacobian, 9, i);
    }
    /// z = ∇(nodal field) from its sums in natural directions.
    void load_gradient(const double (*natural)[kMaxRows], const V* jacobian, V* z) const {
      V local[nz];
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r) local[3 * a + r] = load(natural[a], 3, r);
      Kin::to_point(local, jacobian, z);
    }
    /// The transpose: z̄ at the points to sums in natural directions; no weight.
    void store_gradient(const V* z_bar, const V* jacobian, double (*natural)[kMaxRows]) const {
      V local[nz];
      Kin::from_point(z_bar, jacobian, broadcast<V>(1), local);
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r) store(local[3 * a + r], natural[a], 3, r);
    }
    const double* rest() const { return v.rest ? v.rest + point[0] * Law::nrest : nullptr; }
  };

  /// As PointKernel::adjoint_update.
  static void adjoint_update(const Law& law, const ElementView& v, const double* u, const double* prepared,
                             const double* s_bar, double* u_bar) {
    if constexpr (ns > 0) {
      Tape& tape = Tape::mine();
      double natural[3][kMaxRows], out[3][kMaxRows];
      gather<3>(v, u, natural);
      for (int first = 0; first < v.num_points; first += width) {
        const Pack p(v, first);
        V jacobian[9], h[nz], y[ne], y_bar[ne], h_bar[nz];
        p.load_jacobian(jacobian);
        p.load_gradient(natural, jacobian, h);
        Kin::strain(h, y);
        Number e[ne], old[at_least_one(np)], theta[nt], s_new[ns];
        tape.begin();
        for (int c = 0; c < ne; ++c) e[c] = Number::input(y[c]);
        for (int c = 0; c < np; ++c) old[c] = Number::constant(p.load(prepared, np, c));
        p.load_theta(theta, false);
        law.template update<Number>(e, old, theta, p.rest(), v.dt, s_new);
        tape.clear_bars();
        for (int c = 0; c < ns; ++c) tape.bar(s_new[c].node) += p.load(s_bar, ns, c);
        tape.sweep();
        for (int c = 0; c < ne; ++c) y_bar[c] = tape.bar(e[c].node);
        Kin::strain_transpose(h, y_bar, h_bar);
        p.store_gradient(h_bar, jacobian, out);
      }
      scatter<3>(v, out, u_bar);
    }
  }

  /// As PointKernel::adjoint_step.
  static void adjoint_step(const Law& law, const ElementView& v, const double* u, const double* u_old,
                           const double* s_old, const double* prepared, const double* adj,
                           const double* s_bar, double* u_old_bar, double* s_old_bar, double* theta_bar) {
    Tape& tape = Tape::mine();
    double natural[3][kMaxRows], natural_old[3][kMaxRows], natural_adj[3][kMaxRows], out[3][kMaxRows];
    gather<3>(v, u, natural);
    gather<3>(v, adj, natural_adj);
    if constexpr (np > 0) gather<3>(v, u_old, natural_old);
    for (int first = 0; first < v.num_points; first += width) {
      const Pack p(v, first);
      V jacobian[9], h[nz], y[ne], dh[nz], dy[ne];
      p.load_jacobian(jacobian);
      p.load_gradient(natural, jacobian, h);
      p.load_gradient(natural_adj, jacobian, dh);
      Kin::strain(h, y);
      Kin::strain_direction(h, dh, dy);
      const V weight = p.load(v.weight, 1, 0);
      V prepared_bar[at_least_one(np)], theta_sum[nt];
      {
        Number e[ne], old[at_least_one(np)], theta[nt], sigma[ne], s_new[at_least_one(ns)];
        tape.begin();
        for (int c = 0; c < ne; ++c) e[c] = Number::constant(y[c]);
        for (int c = 0; c < np; ++c) old[c] = Number::input(p.load(prepared, np, c));
        p.load_theta(theta, true);
        (void)law.template stress<Number>(e, old, theta, p.rest(), v.dt, sigma);
        if constexpr (ns > 0) law.template update<Number>(e, old, theta, p.rest(), v.dt, s_new);
        tape.clear_bars();
        for (int c = 0; c < ne; ++c) tape.bar(sigma[c].node) -= weight * dy[c];
        for (int c = 0; c < ns; ++c) tape.bar(s_new[c].node) += p.load(s_bar, ns, c);
        tape.sweep();
        for (int c = 0; c < np; ++c) prepared_bar[c] = tape.bar(old[c].node);
        for (int c = 0; c < nt; ++c) theta_sum[c] = tape.bar(theta[c].node);
      }
      if constexpr (np > 0) {
        V h_old[nz], y_old[ne], y_bar[ne], h_bar[nz];
        p.load_gradient(natural_old, jacobian, h_old);
        Kin::strain(h_old, y_old);
        Number e[ne], s[at_least_one(ns)], theta[nt], made[np];
        tape.begin();
        for (int c = 0; c < ne; ++c) e[c] = Number::input(y_old[c]);
        for (int c = 0; c < ns; ++c) s[c] = Number::input(p.load(s_old, ns, c));
        p.load_theta(theta, true);
        law.template prepare<Number>(e, s, theta, p.rest(), v.dt, made);
        tape.clear_bars();
        for (int c = 0; c < np; ++c) tape.bar(made[c].node) += prepared_bar[c];
        tape.sweep();
        for (int c = 0; c < ne; ++c) y_bar[c] = tape.bar(e[c].node);
        Kin::strain_transpose(h_old, y_bar, h_bar);
        p.store_gradient(h_bar, jacobian, out);
        for (int c = 0; c < ns; ++c) p.store(tape.bar(s[c].node), s_old_bar, ns, c);
        for (int c = 0; c < nt; ++c) theta_sum[c] += tape.bar(theta[c].node);
      }
      for (int c = 0; c < nt; ++c) p.store(theta_sum[c], theta_bar, nt, c);
    }
    if constexpr (np > 0) scatter<3>(v, out, u_old_bar);
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
