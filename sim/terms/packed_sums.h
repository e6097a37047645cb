// Sums between the nodes and the points of a prism in the order that packs of points want: component by component,
// points beside each other. Elements that are products of plane and line are summed one direction at a time, which
// takes as many times fewer operations as a line has nodes.
//
//   natural[3a + r][k] = Σ_i u[i][a] table[q(k)·3 + r][i]        N_(jc) = P_j(u,v) T_c(w), i = j · line nodes + c
//                      = Σ_c g_r,c(z) Σ_j G_r,j(t) u[jc][a]      G = P,u P,v P;  g = T T T';  q = t · line points + z
//
// Points of a product are numbered k = z · plane points + t; all others k = q.
//
// Shapes   natural [9][kMaxPacked]
// Tests    tests/sim/terms/term_kernels_test.cpp
#pragma once

#include <cstring>

#include "sim/math/lane_transpose.h"
#include "sim/terms/element_sums.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Length of a row of values at points: packs may run past the last point.
inline constexpr int kMaxPacked = kMaxRows / 3 + 8;

inline Lanes load_lanes(const double* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof lanes);
  return lanes;
}
inline void store_lanes(const Lanes& lanes, double* to) {
  std::memcpy(to, &lanes, sizeof lanes);
}

/// A pack of value(0), value(1) ...: numbers in registers, since a pack read back from single numbers in memory waits
/// until they have got there.
template <class F>
[[gnu::always_inline]] inline Lanes make_lanes(F&& value) {
  if constexpr (kLanes == 8)
    return Lanes{value(0), value(1), value(2), value(3), value(4), value(5), value(6), value(7)};
  else if constexpr (kLanes == 4)
    return Lanes{value(0), value(1), value(2), value(3)};
  else
    return Lanes{value(0), value(1)};
}

/// Calls f with n, 1 ≤ n ≤ most, as a constant; with `most` for larger ones.
template <int most, class F>
void with_constant(int n, F&& f) {
  if constexpr (most > 1)
    if (n < most) return with_constant<most - 1>(n, f);
  f(std::integral_constant<int, most>{});
}

/// The sums of one element.
class PackedSums {
 public:
  explicit PackedSums(const ElementView& v) : v_(v), p_(v.product) {
    const int nz = p_.line_points, nq = v.num_points;
    if (nz > 0) {
      plane_points_ = nq / nz;
      for (int z = 0, k = 0; z < nz; ++z)
        for (int t = 0; t < plane_points_; ++t) points_[k++] = t * nz + z;
    } else {
      for (int k = 0; k < nq; ++k) points_[k] = k;
    }
    for (int k = nq; k < nq + kLanes - 1; ++k) points_[k] = nq - 1;  // the last in either order
  }

  /// Index q of the k-th point; past the end that of the last, again and again.
  const int* points() const { return points_; }

  /// Values past the last point, to the end of a pack, are those of the last.
  void gather(const double* u, double (*natural)[kMaxPacked]) {
    if (plane_points_ > 0)
      gather_product(u, natural);
    else
      gather_rows(u, natural);
    const int nq = v_.num_points;
    for (int i = 0; i < 9; ++i)
      for (int k = nq; k < nq + kLanes - 1; ++k) natural[i][k] = natural[i][nq - 1];
  }

  /// The same with the points in their own order, k = q, in values and points().
  void gather_in_order(const double* u, double (*natural)[kMaxPacked]) {
    gather(u, natural);
    const int nq = v_.num_points;
    if (plane_points_ > 0)
      for (int i = 0; i < 9; ++i) {
        double packed[kMaxPacked];
        std::memcpy(packed, natural[i], sizeof(double) * static_cast<std::size_t>(nq));
        for (int k = 0; k < nq; ++k) natural[i][points_[k]] = packed[k];
      }
    for (int k = 0; k < nq; ++k) points_[k] = k;
  }

  /// f[i][a] += Σ natural · table.
  void scatter(const double (*natural)[kMaxPacked], double* f) {
    if (plane_points_ > 0)
      scatter_product(natural, f);
    else
      scatter_rows(natural, f);
  }

 private:
  /// Vectors of a register tile, by three components each.
  static constexpr int kTile = kLanes == 8 ? 5 : 3;
  /// Length of a row of sums over the plane, one per (line node, component): [∂/∂u, ∂/∂v, value by t].
  static constexpr int kStride = kMaxRows + 16;

  double* plane_sums(int c, int a) { return plane_sums_[3 * c + a]; }

  /// sums[a][row] = Σ_j u[j][a] table[j][row] for `count` vectors of rows; u's rows lie `stride` apart.
  template <int count>
  static void add_nodes(const double* table, int table_stride, int nodes, const double* u, int stride,
                        double* sums) {
    Lanes x[count] = {}, y[count] = {}, z[count] = {};
    for (int j = 0; j < nodes; ++j, table += table_stride, u += stride)
      unroll<count>([&](auto k) __attribute__((always_inline)) {
        const Lanes t = load_lanes(table + k * kLanes);
        x[k] += u[0] * t;
        y[k] += u[1] * t;
        z[k] += u[2] * t;
      });
    unroll<count>([&](auto k) __attribute__((always_inline)) {
      store_lanes(x[k], sums + k * kLanes);
      store_lanes(y[k], sums + kStride + k * kLanes);
      store_lanes(z[k], sums + 2 * kStride + k * kLanes);
    });
  }

  /// to[o][t] = Σ_i line[o][i] from[i][t], 0 ≤ t < count, for `inputs` rows and `outputs` rows. Writes up to a pack
  /// too far; what lies there must be written later, as the next output is.
  template <int inputs>
  static void sum_line(const double* from, int from_stride, const double* line, int by_input, int by_output,
                       int outputs, double* to, int to_stride, int count) {
    for (int t = (count - 1) / kLanes * kLanes; t >= 0; t -= kLanes) {
      Lanes in[inputs];
      unroll<inputs>([&](auto i)
                         __attribute__((always_inline)) { in[i] = load_lanes(from + i * from_stride + t); });
      for (int o = 0; o < outputs; ++o) {
        const double* const factor = line + o * by_output;
        Lanes sum = factor[0] * in[0];
        unroll<inputs - 1>([&](auto i) __attribute__((always_inline)) {
          sum += factor[(i + 1) * by_input] * in[i + 1];
        });
        store_lanes(sum, to + o * to_stride + t);
      }
    }
  }

  void gather_product(const double* u, double (*natural)[kMaxPacked]) {
    const int nl = p_.line_nodes, vectors = (3 * plane_points_ + kLanes - 1) / kLanes;
    for (int c = 0; c < nl; ++c)
      for (int first = 0; first < vectors; first += kTile)
        with_constant<kTile>(vectors - first, [&](auto count) {
          add_nodes<count>(p_.plane_by_node + first * kLanes, p_.padded_plane_rows, p_.plane_nodes, u + 3 * c,
                           3 * nl, plane_sums(c, 0) + first * kLanes);
        });
    with_constant<kMaxLineNodes>(nl, [&](auto inputs) {
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r)
          sum_line<inputs>(plane_sums(0, a) + r * plane_points_, 3 * kStride,
                           p_.line + (r == 2) * kLineStride, 1, 2 * kLineStride, p_.line_points,
                           natural[3 * a + r], plane_points_, plane_points_);
    });
  }

  void scatter_product(const double (*natural)[kMaxPacked], double* f) {
    const int nl = p_.line_nodes;
    with_constant<kMaxLinePoints>(p_.line_points, [&](auto inputs) {
      for (int a = 0; a < 3; ++a)
        for (int r = 0; r < 3; ++r)
          sum_line<inputs>(natural[3 * a + r], plane_points_, p_.line + (r == 2) * kLineStride,
                           2 * kLineStride, 1, nl, plane_sums(0, a) + r * plane_points_, 3 * kStride,
                           plane_points_);
    });
    // Tiles of 16 nodes, or 4 with two lanes, by as many line nodes as registers hold.
    constexpr int width = 2, most = kLanes == 8 ? 3 : 2;
    for (int c = 0; c < nl; c += most)
      with_constant<most>(nl - c, [&](auto columns) {
        for (int j = 0; j < p_.plane_nodes; j += width * kLanes)
          with_constant<width>((p_.plane_nodes - j + kLanes - 1) / kLanes,
                               [&](auto count) { add_points<count, columns>(c, j, f); });
      });
  }

  /// Adds to nodes (j …, c …): `count` vectors of plane nodes by `columns` line nodes.
  template <int count, int columns>
  void add_points(int c, int j, double* f) {
    constexpr int rows = 3 * columns;
    Lanes sum[rows * count] = {};
    const double *table = p_.plane + j, *const values = plane_sums(c, 0);
    for (int t = 0; t < plane_points_; ++t)
      for (int r = 0; r < 3; ++r, table += p_.padded_plane_nodes) {
        const double* const value = values + r * plane_points_ + t;
        Lanes g[count];
        unroll<count>([&](auto k) __attribute__((always_inline)) { g[k] = load_lanes(table + k * kLanes); });
        unroll<rows>([&](auto a) __attribute__((always_inline)) {
          unroll<count>([&](auto k) __attribute__((always_inline)) {
            sum[a * count + k] += value[a * kStride] * g[k];
          });
        });
      }
    const int nodes = p_.plane_nodes - j < count * kLanes ? p_.plane_nodes - j : count * kLanes;
    double numbers[rows][count * kLanes];
    unroll<rows * count>([&](auto i) __attribute__((always_inline)) {
      store_lanes(sum[i], &numbers[0][0] + i * kLanes);
    });
    for (int k = 0; k < nodes; ++k)
      for (int a = 0; a < rows; ++a) f[3 * ((j + k) * p_.line_nodes + c) + a] += numbers[a][k];
  }

  void gather_rows(const double* u, double (*natural)[kMaxPacked]) {
    double rows[3][kMaxRows];
    rhytid::gather<3>(v_, u, rows);
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < v_.num_points; ++k)
        for (int r = 0; r < 3; ++r) natural[3 * a + r][k] = rows[a][3 * k + r];
  }
  void scatter_rows(const double (*natural)[kMaxPacked], double* f) {
    double rows[3][kMaxRows];
    for (int a = 0; a < 3; ++a)
      for (int k = 0; k < v_.num_points; ++k)
        for (int r = 0; r < 3; ++r) rows[a][3 * k + r] = natural[3 * a + r][k];
    rhytid::scatter<3>(v_, rows, f);
  }

  static constexpr int kMaxLineNodes = 5;

  const ElementView& v_;
  const ProductView& p_;
  int plane_points_ = 0;
  int points_[kMaxPacked];
  alignas(8 * kLanes) double plane_sums_[3 * kMaxLineNodes][kStride];
};

/// Entries 0 … count − 1 < kLanes + 1 of a row; the rest is 0. Reads nothing past them.
template <int count>
[[gnu::always_inline]] inline Lanes load_first(const double* row) {
  if constexpr (count >= kLanes) {
    return load_lanes(row);
  } else {
#if defined(__AVX512F__) && defined(__AVX512DQ__)
    return _mm512_maskz_loadu_pd(static_cast<__mmask8>((1 << count) - 1), row);
#else
    return make_lanes([&](int i) { return i < count ? row[i] : 0.0; });
#endif
  }
}

/// out[i] = entries i of the rows [count] that start at `rows`, one row per lane.
template <int count>
[[gnu::always_inline]] inline void load_transposed(const double* const* rows, Lanes* out) {
  // Blocks of kLanes; what is left over number by number unless it is worth a block.
  constexpr int left = count % kLanes, in_blocks = left > kLanes / 2 ? count : count - left;
  unroll<(in_blocks + kLanes - 1) / kLanes>([&](auto block) __attribute__((always_inline)) {
    constexpr int first = block * kLanes, size = in_blocks - first < kLanes ? in_blocks - first : kLanes;
    Lanes m[kLanes];
    unroll<kLanes>([&](auto k) __attribute__((always_inline)) { m[k] = load_first<size>(rows[k] + first); });
    transpose(m);
    unroll<size>([&](auto k) __attribute__((always_inline)) { out[first + k] = m[k]; });
  });
  unroll<count - in_blocks>([&](auto i) __attribute__((always_inline)) {
    out[in_blocks + i] = make_lanes([&](int k) { return rows[k][in_blocks + i]; });
  });
}

/// Data [..][count] of the points of a pack, component by component.
template <int count>
void load_points(const double* values, const int* points, Lanes* out) {
  const double* rows[kLanes];
  for (int k = 0; k < kLanes; ++k) rows[k] = values + points[k] * count;
  load_transposed<count>(rows, out);
}

/// The same back, for the first `num` points.
template <int count>
void store_points(const Lanes* in, const int* points, int num, double* values) {
  for (int c = 0; c < count; ++c)
    for (int k = 0; k < num; ++k) values[points[k] * count + c] = in[c][k];
}

/// Parameters of the points of a pack, and constants of the step that make(θ, constants) finds: the same at all points,
/// or not.
template <int nt, int nc>
struct PackedParameters {
  static constexpr int num_constants = nc > 0 ? nc : 1;
  Lanes theta[nt] = {}, constants[num_constants] = {};

  /// What points share, where they do.
  template <class Make>
  PackedParameters(const ElementView& v, const Make& make) {
    if (v.theta_stride != 0) return;
    double own[num_constants];
    make(v.theta, own);
    for (int c = 0; c < nt; ++c) theta[c] = broadcast<Lanes>(v.theta[c]);
    for (int c = 0; c < nc; ++c) constants[c] = broadcast<Lanes>(own[c]);
  }
  /// The same for points that have parameters of their own; apart, since they seldom have.
  template <class Make>
  [[gnu::noinline]] PackedParameters(const ElementView& v, const int* points, const Make& make) {
    double theta_numbers[nt][kLanes] = {}, own_numbers[num_constants][kLanes] = {};
    for (int k = 0; k < kLanes; ++k) {
      const double* th = v.theta + static_cast<std::size_t>(points[k]) * v.theta_stride;
      double own[num_constants];
      make(th, own);
      for (int c = 0; c < nt; ++c) theta_numbers[c][k] = th[c];
      for (int c = 0; c < nc; ++c) own_numbers[c][k] = own[c];
    }
    for (int c = 0; c < nt; ++c) theta[c] = load_lanes(theta_numbers[c]);
    for (int c = 0; c < nc; ++c) constants[c] = load_lanes(own_numbers[c]);
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
