// The element matrix of a prism whose shape functions and quadrature points are both products of plane and line,
// summed one direction at a time: three times fewer operations than point by point over all nodes.
//
//   N_(jc) = P_j(u,v) T_c(w), points (t, z)       rows of the table: G_r,j(t) g_r,c(z), G = P,u P,v P; g = T T T'
//   K_(jca)(ldb) = Σ_t Σ_r G_r,j Σ_s G_s,l B_rs(t)[(ca)(db)],     B = Σ_z g_r,c g_s,d A_(ar)(bs)(t, z)
//
// The pairs (ca)(db) lie in the lanes: sums over the plane multiply packs of them by single numbers of G. Half of them are
// summed, the others being the same with j and l exchanged.
//
// Tests    tests/sim/terms/term_kernels_test.cpp (against the sum point by point)
#pragma once

#include <cstdint>
#include <cstring>

#include "sim/math/lanes.h"
#include "sim/terms/packed_sums.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// How the 54 entries of a point's upper component blocks lie beside each other.
struct BlockEntries {
  static constexpr int size = 54;
  /// Of block (ca ≤ cb).
  static constexpr int block(int ca, int cb) { return ca == 0 ? cb : ca + cb + 1; }  // 00 01 02 11 12 22
  /// Directions r and s of it.
  static constexpr int of(int ca, int cb, int r, int s) { return 9 * block(ca, cb) + 3 * r + s; }
};

/// Calls f(ca, cb, r, s) for all entries.
template <class F>
[[gnu::always_inline]] inline void for_block_entries(F&& f) {
  for (int ca = 0; ca < 3; ++ca)
    for (int cb = ca; cb < 3; ++cb)
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s) f(ca, cb, r, s);
}

/// Σ_q Gᵀ A_q G from point blocks A_q [9][9] in natural directions, weight included; points come in their order.
/// Pairs come by blocks a ≤ b, within them by c and d; c ≤ d where a = b.
class ProductHessian {
 public:
  /// `v.product` is there; `work` holds hessian_work_size() doubles.
  ProductHessian(const ElementView& v, double* work) : v_(v), p_(v.product) {
    if (p_.line_points == 0) return;
    // From a cache line on, so that vectors lie within lines.
    matrix_ = work + (64 - reinterpret_cast<std::uintptr_t>(work) % 64) % 64 / sizeof(double);
    pairs_ = p_.pairs();
    left_ = matrix_ + p_.plane_nodes * p_.plane_nodes * pairs_;
    b_ = left_ + 3 * kPlaneSlots * kMaxWidth * kLanes;
    // As many plane points to a pass as give passes of the same size.
    const int points = v.num_points / p_.line_points, passes = (points + kPlaneSlots - 1) / kPlaneSlots;
    slots_ = (points + passes - 1) / passes;
    with_constant<kMaxLineNodes>(p_.line_nodes, [&](auto nl) { line_products<nl>(); });
  }
  /// Point q's block; consecutive entries lie `stride` apart. Points that are left out have none.
  void add(int q, const double* a, int stride) {
    while (next_ < q) skip();
    double* const to = entries(q);
    for_block_entries([&](int ca, int cb, int r, int s) {
      to[BlockEntries::of(ca, cb, r, s) * kLanes] = a[((ca * 3 + r) * 9 + cb * 3 + s) * stride];
    });
    is_filled_ = true;
    advance();
  }
  /// Where the blocks of points first … first + kLanes − 1 go, entry by entry, one per lane; `first` is a multiple of
  /// kLanes.
  Lanes* pack(int first) { return kept_[first / kLanes % kKeptPacks]; }
  /// The next `count` points' blocks are in their pack.
  void add_pack(int count) {
    for (int k = 0; k < count; ++k) {
      is_filled_ = true;
      advance();
    }
  }

  /// Dense [3n][3n], node-major, full. False, and nothing written, when no point was added.
  bool finish(double* dense) {
    while (next_ % p_.line_points != 0) skip();
    flush();
    if (!begun_) return false;
    with_constant<kMaxLineNodes>(p_.line_nodes, [&](auto nl) { unpack<nl>(dense); });
    return true;
  }

 private:
  static constexpr int kMaxLineNodes = ProductView::kMaxLineNodes, kPlaneSlots = ProductView::kPlaneSlots;
  /// Nodes of the plane in a register tile, at most.
  static constexpr int kMaxWidth = 5;
  /// Packs whose entries are kept: those that the points of one plane point may lie in.
  static constexpr int kKeptPacks = 16 / kLanes;
  static_assert(16 >= kMaxLinePoints + kLanes);
  static constexpr int kMaxVectors = (kMaxLineNodes * kMaxLineNodes + kLanes - 1) / kLanes;

  double* entries(int q) { return reinterpret_cast<double*>(kept_[q / kLanes % kKeptPacks]) + q % kLanes; }
  void skip() {
    double* const to = entries(next_);
    for (int k = 0; k < BlockEntries::size; ++k) to[k * kLanes] = 0;
    advance();
  }
  /// The next point's entries are there.
  void advance() {
    ++next_;
    if (next_ % p_.line_points != 0) return;
    if (is_filled_) {
      if (filled_ == slots_) flush();
      with_constant<kMaxLineNodes>(p_.line_nodes, [&](auto nl) {
        with_constant<kMaxLinePoints>(p_.line_points,
                                      [&](auto nz) { contract<nl, nz>(next_ / p_.line_points - 1); });
      });
      ++filled_;
    }
    is_filled_ = false;
  }

  /// First pair of block (ca ≤ cb), of `nl` line nodes.
  static constexpr int first_pair(int nl, int ca, int cb) {
    const int full = nl * nl, half = nl * (nl + 1) / 2;
    return ca == 0 ? (cb > 0) * half + (cb > 1) * full
                   : 2 * full + half + (ca > 1 || cb > 1) * half + (ca > 1) * full;
  }
  /// Of a pair of line nodes within it.
  static constexpr int pair(int nl, bool is_half, int c, int d) {
    return is_half ? c * nl - c * (c - 1) / 2 + d - c : c * nl + d;
  }

  /// Products g_r,c g_s,d at the line points, as pairs lie beside each other.
  template <int nl>
  void line_products() {
    for (int half = 0; half < 2; ++half)
      for (int kind = 0; kind < 4; ++kind)
        for (int z = 0; z < p_.line_points; ++z) {
          const double* const values = p_.line + z * 2 * kLineStride;
          const double *const left = values + (kind / 2) * kLineStride, *const right =
                                                                            values + (kind % 2) * kLineStride;
          double* const to = reinterpret_cast<double*>(products_[half][kind][z]);
          for (int c = 0; c < nl; ++c)
            for (int d = half ? c : 0; d < nl; ++d) to[pair(nl, half, c, d)] = left[c] * right[d];
        }
  }

  /// B of plane point t into a slot, [r][s][pair].
  template <int nl, int nz>
  void contract(int t) {
    for (int r = 0; r < 3; ++r)
      plane_rows_[3 * filled_ + r] = p_.plane + (static_cast<std::size_t>(t) * 3 + r) * p_.padded_plane_nodes;
    double* slot = b_ + static_cast<std::size_t>(filled_) * 9 * pairs_;
    const double* from[nz];
    for (int z = 0; z < nz; ++z) from[z] = entries(t * nz + z);
    // In the order of pairs: what a block writes too far, the next one overwrites.
    for (int r = 0; r < 3; ++r)
      for (int s = 0; s < 3; ++s, slot += pairs_) {
        const int kind = 2 * (r == 2) + (s == 2), entry = (3 * r + s) * kLanes;
        unroll<3>([&](auto ca) __attribute__((always_inline)) {
          unroll<3 - ca>([&](auto step) __attribute__((always_inline)) {
            constexpr int cb = ca + step, block = BlockEntries::of(ca, cb, 0, 0);
            constexpr bool is_half = step == 0;
            constexpr int count = is_half ? nl * (nl + 1) / 2 : nl * nl,
                          vectors = (count + kLanes - 1) / kLanes;
            const Lanes(*const g)[kMaxVectors] = products_[is_half][kind];
            Lanes sum[vectors] = {};
            unroll<nz>([&](auto z) __attribute__((always_inline)) {
              const double a = from[z][block * kLanes + entry];
              unroll<vectors>([&](auto k) __attribute__((always_inline)) { sum[k] += a * g[z][k]; });
            });
            unroll<vectors>([&](auto k) __attribute__((always_inline)) {
              store_lanes(sum[k], slot + first_pair(nl, ca, cb) + k * kLanes);
            });
          });
        });
      }
  }

  /// Adds the plane points of the slots to the matrix.
  void flush() {
    if (filled_ == 0) return;
    const int np = p_.plane_nodes;
    if (kLanes == 8 && np % 5 == 0)
      add_slots<5, 5>();
    else if (np % 3 == 0)
      add_slots<3, 3>();
    else
      add_slots<5, 2>();
    begun_ = true;
    filled_ = 0;
  }
  /// In tiles of `height` by `width` nodes by a pack of pairs.
  template <int height, int width>
  void add_slots() {
    for (int pair = 0; pair < pairs_; pair += kLanes)
      for (int l = 0; l < p_.plane_nodes; l += width) {
        make_left<width>(l, b_ + pair);
        for (int j = 0; j < p_.plane_nodes; j += height)
          multiply<height, width>(j, matrix_ + (j * p_.plane_nodes + l) * pairs_ + pair);
      }
  }

  /// left_[row (t, r)][l] = Σ_s B_rs(t) G_s,l(t) for `width` plane nodes and the pairs at b.
  template <int width>
  [[gnu::noinline]] void make_left(int l, const double* b) {
    const int stride = p_.padded_plane_nodes, pairs = pairs_;
    double* to = left_;
    for (int slot = 0; slot < filled_; ++slot, b += 9 * pairs, to += 3 * width * kLanes) {
      const double* const g = plane_rows_[3 * slot] + l;
      if constexpr (kLanes == 8) {
        Lanes in[9];
        unroll<9>([&](auto k) __attribute__((always_inline)) { in[k] = load_lanes(b + k * pairs); });
        unroll<width>([&](auto i) __attribute__((always_inline)) {
          const Lanes g0 = broadcast<Lanes>(g[i]), g1 = broadcast<Lanes>(g[stride + i]),
                      g2 = broadcast<Lanes>(g[2 * stride + i]);
          unroll<3>([&](auto r) __attribute__((always_inline)) {
            store_lanes(in[3 * r] * g0 + in[3 * r + 1] * g1 + in[3 * r + 2] * g2,
                        to + (r * width + i) * kLanes);
          });
        });
      } else {
        unroll<3>([&](auto r) __attribute__((always_inline)) {
          const Lanes b0 = load_lanes(b + 3 * r * pairs), b1 = load_lanes(b + (3 * r + 1) * pairs),
                      b2 = load_lanes(b + (3 * r + 2) * pairs);
          unroll<width>([&](auto i) __attribute__((always_inline)) {
            store_lanes(b0 * g[i] + b1 * g[stride + i] + b2 * g[2 * stride + i],
                        to + (r * width + i) * kLanes);
          });
        });
      }
    }
  }

  /// k [height][width] += Σ_row G[row][j …] left[row][…]; k's rows lie a row of nodes apart.
  template <int height, int width>
  [[gnu::noinline]] void multiply(int j, double* k) const {
    Lanes sum[height * width] = {};
    const int row_stride = p_.plane_nodes * pairs_, pairs = pairs_;
    if (begun_)
      unroll<height * width>([&](auto i) __attribute__((always_inline)) {
        sum[i] = load_lanes(k + i / width * row_stride + i % width * pairs);
      });
    const double* left = left_;
    for (int row = 0; row < 3 * filled_; ++row, left += width * kLanes) {
      const double* const g = plane_rows_[row] + j;
      Lanes factor[width];
      unroll<width>([&](auto l)
                        __attribute__((always_inline)) { factor[l] = load_lanes(left + l * kLanes); });
      unroll<height>([&](auto i) __attribute__((always_inline)) {
        unroll<width>([&](auto l) __attribute__((always_inline)) { sum[i * width + l] += g[i] * factor[l]; });
      });
    }
    unroll<height * width>([&](auto i) __attribute__((always_inline)) {
      store_lanes(sum[i], k + i / width * row_stride + i % width * pairs);
    });
  }

  /// From [j][l][pair] to [j][c][a][l][d][b]; the halves that were not summed are taken from (l, j).
  template <int nl>
  void unpack(double* dense) const {
    const int np = p_.plane_nodes, n3 = 3 * nl * np;
    for (int j = 0; j < np; ++j)
      for (int l = 0; l < np; ++l) {
        const double *const own = matrix_ + (j * np + l) * pairs_, *const mirrored =
                                                                       matrix_ + (l * np + j) * pairs_;
        double* const corner = dense + static_cast<std::size_t>(3 * nl * j) * n3 + 3 * nl * l;
        unroll<3 * nl>([&](auto row) __attribute__((always_inline)) {
          constexpr int c = row / 3, a = row % 3;
          double* const to = corner + row * n3;
          unroll<3 * nl>([&](auto column) __attribute__((always_inline)) {
            constexpr int d = column / 3, b = column % 3;
            if constexpr (a < b || (a == b && c <= d))
              to[column] = own[first_pair(nl, a, b) + pair(nl, a == b, c, d)];
            else
              to[column] = mirrored[first_pair(nl, b, a) + pair(nl, a == b, d, c)];
          });
        });
      }
  }

  const ElementView& v_;
  const ProductView& p_;
  int pairs_ = 0, slots_ = 0;
  double *matrix_ = nullptr, *left_ = nullptr, *b_ = nullptr;
  const double* plane_rows_[3 * kPlaneSlots] = {};  ///< of the slots
  int next_ = 0, filled_ = 0;                       ///< point; slots
  bool is_filled_ = false, begun_ = false;          ///< the current plane point; the matrix
  Lanes kept_[kKeptPacks][BlockEntries::size];      ///< of the last points
  Lanes products_[2][4][kMaxLinePoints][kMaxVectors] = {};
};

/// The element matrix, by whichever sum the element allows; functions as those of the two.
template <int R>
class ElementHessian : public HessianBlocks<R> {
 public:
  using HessianBlocks<R>::HessianBlocks;
};
template <>
class ElementHessian<3> {
 public:
  ElementHessian(const ElementView& v, double* work)
      : is_product_(v.product.line_points > 0), product_(v, work), blocks_(v, work) {}
  void add(int q, const double* a, int stride) {
    is_product_ ? product_.add(q, a, stride) : blocks_.add(q, a, stride);
  }
  /// Where points first … first + kLanes − 1 go, one per lane: BlockEntries.
  Lanes* pack(int first) { return is_product_ ? product_.pack(first) : pack_; }
  /// The first `count` of that pack are there.
  void add_pack(int first, int count) {
    if (is_product_) return product_.add_pack(count);
    for (int k = 0; k < count; ++k) {
      double a[81];
      for_block_entries([&](int ca, int cb, int r, int s) {
        a[(ca * 3 + r) * 9 + cb * 3 + s] = pack_[BlockEntries::of(ca, cb, r, s)][k];
      });
      blocks_.add(first + k, a, 1);
    }
  }
  bool finish(double* dense) { return is_product_ ? product_.finish(dense) : blocks_.finish(dense); }

 private:
  bool is_product_;
  ProductHessian product_;
  HessianBlocks<3> blocks_;
  Lanes pack_[BlockEntries::size];
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
