// The element matrix of a prism whose shape functions and quadrature points are both products of plane and line,
// summed one direction at a time: three times fewer operations than point by point over all nodes.
//
//   N_(jc) = P_j(u,v) T_c(w), points (t, z)       rows of the table: G_r,j(t) g_r,c(z), G = P,u P,v P; g = T T T'
//   K_(jca)(ldb) = Σ_t Σ_rs G_r,j G_s,l B_(rca)(sdb)(t)        B = Σ_z g_r,c g_s,d A_(ar)(bs)(t, z)
//
// Tests    tests/sim/terms/term_kernels_test.cpp (against the sum point by point)
#pragma once

#include <cstdint>
#include <cstring>

#include "sim/math/lanes.h"
#include "sim/terms/packed_sums.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// How the 54 entries of a point's upper component blocks lie beside each other: by what happens to them through the
/// thickness (derivatives there on neither side, on the right, on the left, on both), each kind filled up to vectors of 8.
struct BlockEntries {
  static constexpr int size = 64, begin[5] = {0, 24, 40, 56, 64};
  /// Of block (ca ≤ cb), directions r and s.
  static constexpr int of(int ca, int cb, int r, int s) {
    const int block = ca == 0 ? cb : ca + cb + 1;  // 00 01 02 11 12 22
    if (r < 2) return s < 2 ? 4 * block + 2 * r + s : begin[1] + 2 * block + r;
    return s < 2 ? begin[2] + 2 * block + s : begin[3] + block;
  }
};

/// BlockEntries::of by [ca][cb][r][s].
inline constexpr auto kEntry = [] {
  struct {
    int of[3][3][3][3];
    constexpr auto& operator[](int k) const { return of[k]; }
  } table{};
  for (int ca = 0; ca < 3; ++ca)
    for (int cb = ca; cb < 3; ++cb)
      for (int r = 0; r < 3; ++r)
        for (int s = 0; s < 3; ++s) table.of[ca][cb][r][s] = BlockEntries::of(ca, cb, r, s);
  return table;
}();

/// Σ_q Gᵀ A_q G from point blocks A_q [9][9] in natural directions, weight included; points come in their order.
class ProductHessian {
 public:
  /// `v.product` is there; `work` holds hessian_work_size() doubles.
  ProductHessian(const ElementView& v, double* work) : v_(v), p_(v.product), m_(3 * p_.line_nodes) {
    // From a cache line on, so that vectors lie within lines.
    matrix_ = work + (64 - reinterpret_cast<std::uintptr_t>(work) % 64) % 64 / sizeof(double);
    std::size_t size = 0;
    for (int m = 0; m < m_; ++m) size += static_cast<std::size_t>(p_.plane_nodes) * columns(m);
    left_ = matrix_ + size;
    b_ = left_ + static_cast<std::size_t>(kRows) * (columns(0) + kPad);
  }
  /// Point q's block; consecutive entries lie `stride` apart. Points that are left out have none.
  void add(int q, const double* a, int stride) {
    while (next_ < q) {
      std::memset(row(next_), 0, sizeof(double) * BlockEntries::size);
      advance();
    }
    double* const to = row(q);
    for (int ca = 0; ca < 3; ++ca)
      for (int cb = ca; cb < 3; ++cb)
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s)
            to[BlockEntries::of(ca, cb, r, s)] = a[((ca * 3 + r) * 9 + cb * 3 + s) * stride];
    is_filled_ = true;
    advance();
  }
  /// The blocks of points first … first + count − 1, one per lane; `first` is a multiple of kLanes.
  void add_pack(int first, int count, const Lanes (*a)[9]) {
    for (int begin = 0; begin < BlockEntries::size; begin += kLanes) {
      Lanes block[kLanes] = {};
      for (int ca = 0; ca < 3; ++ca)
        for (int cb = ca; cb < 3; ++cb)
          for (int r = 0; r < 3; ++r)
            for (int s = 0; s < 3; ++s) {
              const int entry = BlockEntries::of(ca, cb, r, s) - begin;
              if (entry >= 0 && entry < kLanes) block[entry] = a[3 * ca + r][3 * cb + s];
            }
      transpose(block);
      for (int k = 0; k < kLanes; ++k) std::memcpy(row(first + k) + begin, &block[k], sizeof(Lanes));
    }
    for (int k = 0; k < count; ++k) {
      is_filled_ = true;
      advance();
    }
  }

  /// Dense [3n][3n], node-major, full. False, and nothing written, when no point was added.
  bool finish(double* dense) {
    while (next_ % p_.line_points != 0) {
      std::memset(row(next_), 0, sizeof(double) * BlockEntries::size);
      advance();
    }
    flush();
    if (!begun_) return false;
    const int nl = p_.line_nodes, np = p_.plane_nodes, n3 = 3 * v_.num_nodes;
    const double* rows[3 * kMaxLineNodes];  // of every m, from column e = m on
    rows[0] = matrix_;
    for (int m = 1; m < m_; ++m) rows[m] = rows[m - 1] + static_cast<std::size_t>(np) * columns(m - 1);
    for (int m = 0; m < m_; ++m) {
      const int a = m / nl, c = m % nl;
      for (int j = 0; j < np; ++j) {
        double* const to = dense + static_cast<std::size_t>(3 * (j * nl + c) + a) * n3;
        for (int e = 0; e < m_; ++e) {
          double* const column = to + 3 * (e % nl) + e / nl;
          // What lies below the diagonal is taken from above it.
          const double* from = e < m ? rows[e] + (m - e) * np + j : rows[m] + j * columns(m) + (e - m) * np;
          const int step = e < m ? columns(e) : 1;
          for (int l = 0; l < np; ++l) column[3 * nl * l] = from[l * step];
        }
      }
    }
    return true;
  }

 private:
  static constexpr int kMaxLineNodes = 5, kTile = 2 * kLanes, kPad = 16, kSlots = kHessianRows / 3,
                       kRows = kHessianRows;
  static_assert(kPad >= kTile);
  /// Points whose entries are kept: those of one plane point and of the packs that these may lie in.
  static constexpr int kKept = 16;
  static_assert(kKept >= kMaxLinePoints + kLanes);

  /// Columns of the rows (·, c, a), m = a · line nodes + c: those of m and after, padded.
  int columns(int m) const { return ((m_ - m) * p_.plane_nodes + kTile - 1) / kTile * kTile; }
  double* row(int q) { return kept_[q % kKept]; }

  /// The next point's entries are there.
  void advance() {
    ++next_;
    if (next_ % p_.line_points != 0) return;
    if (is_filled_) contract(next_ / p_.line_points - 1);
    is_filled_ = false;
  }

  /// B of plane point t into a slot, [c][d][entry].
  void contract(int t) {
    if (filled_ == kSlots) flush();
    const int nl = p_.line_nodes, nz = p_.line_points;
    for (int r = 0; r < 3; ++r)
      plane_rows_[3 * filled_ + r] = p_.plane + (static_cast<std::size_t>(t) * 3 + r) * p_.padded_plane_nodes;
    double* const to = b_ + static_cast<std::size_t>(filled_) * nl * nl * BlockEntries::size;
    with_constant<kMaxLinePoints>(nz, [&](auto points) {
      for (int kind = 0; kind < 4; ++kind) {
        const double *const left = p_.line + (kind >= 2) * kLineStride, *const right =
                                                                            p_.line +
                                                                            (kind % 2) * kLineStride;
        for (int k = BlockEntries::begin[kind]; k < BlockEntries::begin[kind + 1]; k += kLanes) {
          Lanes a[points];
          unroll<points>([&](auto z)
                             __attribute__((always_inline)) { a[z] = load_lanes(row(t * points + z) + k); });
          for (int c = 0; c < nl; ++c)
            for (int d = 0; d < nl; ++d) {
              Lanes sum = {};
              unroll<points>([&](auto z) __attribute__((always_inline)) {
                constexpr int at = 2 * kLineStride * z;
                sum += (left[at + c] * right[at + d]) * a[z];
              });
              store_lanes(sum, to + (c * nl + d) * BlockEntries::size + k);
            }
        }
      }
    });
    ++filled_;
  }

  /// Adds the plane points of the slots to the matrix.
  void flush() {
    if (filled_ == 0) return;
    const int nl = p_.line_nodes, np = p_.plane_nodes;
    if (!begun_) {
      std::memset(matrix_, 0, sizeof(double) * static_cast<std::size_t>(left_ - matrix_));
      begun_ = true;
    }
    double* k = matrix_;
    for (int a = 0; a < 3; ++a)
      for (int c = 0; c < nl; ++c) {
        const int n = columns(a * nl + c);
        with_constant<16 / kLanes>((np + kLanes - 1) / kLanes,
                                   [&](auto vectors) { make_left<vectors>(a, c, n); });
        if (np % 5 == 0)
          multiply<5>(3 * filled_, n, n + kPad, k);
        else
          multiply<3>(3 * filled_, n, n + kPad, k);
        k += static_cast<std::size_t>(np) * n;
      }
    filled_ = 0;
  }

  /// left_[row][(e, l)] = Σ_s B_(r m)(s e) G_s,l for m = (a, c), e ≥ m; plane nodes fill `vectors`.
  template <int vectors>
  void make_left(int a, int c, int n) {
    const int nl = p_.line_nodes, np = p_.plane_nodes;
    for (int slot = 0; slot < filled_; ++slot) {
      const double* const plane = plane_rows_[3 * slot];
      Lanes g[3][vectors];
      for (int s = 0; s < 3; ++s)
        for (int v = 0; v < vectors; ++v)
          std::memcpy(&g[s][v], plane + s * p_.padded_plane_nodes + v * kLanes, sizeof(Lanes));
      const double* const of_c = b_ + (static_cast<std::size_t>(slot) * nl + c) * nl * BlockEntries::size;
      for (int r = 0; r < 3; ++r) {
        double* const begin = left_ + static_cast<std::size_t>(3 * slot + r) * (n + kPad);
        double* to = begin;
        for (int b = a; b < 3; ++b) {
          const int* const entry = kEntry[a][b][r];
          for (int d = b == a ? c : 0; d < nl; ++d, to += np) {
            const double* const entries = of_c + d * BlockEntries::size;
            const double b0 = entries[entry[0]], b1 = entries[entry[1]], b2 = entries[entry[2]];
            for (int v = 0; v < vectors; ++v) {
              const Lanes sum = b0 * g[0][v] + b1 * g[1][v] + b2 * g[2][v];
              std::memcpy(to + v * kLanes, &sum, sizeof sum);
            }
          }
        }
        // The padding columns belong to nobody, but must be numbers.
        for (const double* const end = begin + n; to < end; ++to) *to = 0;
      }
    }
  }

  /// k [plane nodes][n] += Σ_row G[row][j] left[row][·]; plane nodes are a multiple of `height`.
  template <int height>
  void multiply(int rows, int n, int left_stride, double* k) const {
    for (int j = 0; j < p_.plane_nodes; j += height)
      for (int column = 0; column < n; column += kTile) {
        Lanes sum[height][2], left[2];
        double* to[height];
        for (int i = 0; i < height; ++i) {
          to[i] = k + static_cast<std::size_t>(j + i) * n + column;
          load_pair(to[i], sum[i]);
        }
        for (int row = 0; row < rows; ++row) {
          const double* const g = plane_rows_[row] + j;
          load_pair(left_ + static_cast<std::size_t>(row) * left_stride + column, left);
          for (int i = 0; i < height; ++i) {
            sum[i][0] += g[i] * left[0];
            sum[i][1] += g[i] * left[1];
          }
        }
        for (int i = 0; i < height; ++i) {
          std::memcpy(to[i], &sum[i][0], sizeof(Lanes));
          std::memcpy(to[i] + kLanes, &sum[i][1], sizeof(Lanes));
        }
      }
  }
  /// Vector by vector: copied at once, GCC 12 takes half vectors through memory, which stalls.
  static void load_pair(const double* from, Lanes* to) {
    std::memcpy(&to[0], from, sizeof(Lanes));
    std::memcpy(&to[1], from + kLanes, sizeof(Lanes));
  }

  const ElementView& v_;
  const ProductView& p_;
  const int m_;
  double *matrix_, *left_, *b_;
  const double* plane_rows_[kRows] = {};    ///< of the slots
  int next_ = 0, filled_ = 0;               ///< point; slots
  bool is_filled_ = false, begun_ = false;  ///< the current plane point; the matrix
  double kept_[kKept][BlockEntries::size];  ///< of the last points
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
  /// Points first … first + count − 1, one per lane.
  void add_pack(int first, int count, const Lanes (*a)[9]) {
    if (is_product_) return product_.add_pack(first, count, a);
    double flat[81 * kLanes];
    std::memcpy(flat, a, sizeof flat);
    for (int k = 0; k < count; ++k) blocks_.add(first + k, flat + k, kLanes);
  }
  bool finish(double* dense) { return is_product_ ? product_.finish(dense) : blocks_.finish(dense); }

 private:
  bool is_product_;
  ProductHessian product_;
  HessianBlocks<3> blocks_;
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
