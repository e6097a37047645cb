// The element matrix of a prism whose shape functions and quadrature points are both products of plane and line,
// summed one direction at a time: three times fewer operations than point by point over all nodes.
//
//   N_(jc) = P_j(u,v) T_c(w), points (t, z)       rows of the table: G_r,j(t) g_r,c(z), G = P,u P,v P; g = T T T'
//   K_(jca)(ldb) = Σ_t Σ_rs G_r,j G_s,l B_(rca)(sdb)(t)        B = Σ_z g_r,c g_s,d A_(ar)(bs)(t, z)
//
// Tests    tests/sim/terms/term_kernels_test.cpp (against the sum point by point)
#pragma once

#include <cstring>

#include "sim/math/lanes.h"
#include "sim/terms/element_sums.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Σ_q Gᵀ A_q G from point blocks A_q [9][9] in natural directions, weight included; points come in their order.
class ProductHessian {
 public:
  /// `v.product` is there; `work` holds hessian_work_size() doubles.
  ProductHessian(const ElementView& v, double* work)
      : v_(v), p_(v.product), m_(3 * p_.line_nodes), b_columns_(m_ + kPad), matrix_(work) {
    std::size_t size = 0;
    for (int m = 0; m < m_; ++m) size += static_cast<std::size_t>(p_.plane_nodes) * columns(m);
    left_ = matrix_ + size;
    b_ = left_ + static_cast<std::size_t>(kRows) * (columns(0) + kPad);
  }
  /// Point q's block; consecutive entries lie `stride` apart (lanes of a pack).
  void add(int q, const double* a, int stride) {
    const int t = q / p_.line_points, z = q % p_.line_points;
    if (t != plane_point_) begin(t);
    double* to = a_[z];
    for (int ca = 0; ca < 3; ++ca)
      for (int cb = ca; cb < 3; ++cb)
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s) *to++ = a[((ca * 3 + r) * 9 + cb * 3 + s) * stride];
  }

  /// Dense [3n][3n], node-major, full. False, and nothing written, when no point was added.
  bool finish(double* dense) {
    if (plane_point_ < 0) return false;
    contract();
    flush();
    const int nl = p_.line_nodes, np = p_.plane_nodes, n3 = 3 * v_.num_nodes;
    const double* k = matrix_;
    for (int m = 0; m < m_; ++m) {
      const int a = m / nl, c = m % nl, stride = columns(m);
      for (int j = 0; j < np; ++j, k += stride)
        for (int e = m; e < m_; ++e) {
          const int b = e / nl, d = e % nl, row = 3 * (j * nl + c) + a;
          const double* from = k + (e - m) * np;
          for (int l = 0; l < np; ++l) {
            const int column = 3 * (l * nl + d) + b;
            dense[static_cast<std::size_t>(row) * n3 + column] = from[l];
            dense[static_cast<std::size_t>(column) * n3 + row] = from[l];
          }
        }
    }
    return true;
  }

 private:
  static constexpr int kTile = 2 * kLanes, kPad = 8, kSlots = kHessianRows / 3, kRows = kHessianRows;
  static_assert(kPad >= kTile);

  /// Columns of the rows (·, c, a), m = a · line nodes + c: those of m and after, padded.
  int columns(int m) const { return ((m_ - m) * p_.plane_nodes + kTile - 1) / kTile * kTile; }

  void begin(int t) {
    if (plane_point_ >= 0) contract();
    if (filled_ == kSlots) flush();
    plane_point_ = t;
    // Points without energy are left out.
    std::memset(a_, 0, sizeof a_[0] * static_cast<std::size_t>(p_.line_points));
  }

  /// B of the current plane point into its slot, [m][3 slot + r][s][m'].
  void contract() {
    const int nl = p_.line_nodes, vectors = (nl + kLanes - 1) / kLanes;
    for (int r = 0; r < 3; ++r)
      plane_rows_[3 * filled_ + r] =
          p_.plane + (static_cast<std::size_t>(plane_point_) * 3 + r) * p_.padded_plane_nodes;
    int entry = 0;
    for (int a = 0; a < 3; ++a)
      for (int b = a; b < 3; ++b)
        for (int r = 0; r < 3; ++r)
          for (int s = 0; s < 3; ++s, ++entry)
            for (int c = 0; c < nl; ++c) {
              Lanes sum[kLineStride / kLanes] = {};
              for (int z = 0; z < p_.line_points; ++z) {
                const double* const line = p_.line + static_cast<std::size_t>(z) * 2 * kLineStride;
                const double factor = line[(r == 2 ? kLineStride : 0) + c] * a_[z][entry];
                for (int k = 0; k < vectors; ++k) {
                  Lanes g;
                  std::memcpy(&g, line + (s == 2 ? kLineStride : 0) + k * kLanes, sizeof g);
                  sum[k] += factor * g;
                }
              }
              // What a pack writes past nl is overwritten by the next b.
              double* const to = b_at(a * nl + c, 3 * filled_ + r, s) + b * nl;
              for (int k = 0; k < vectors; ++k) std::memcpy(to + k * kLanes, &sum[k], sizeof(Lanes));
            }
    ++filled_;
  }

  double* b_at(int m, int row, int s) {
    return b_ + ((static_cast<std::size_t>(m) * kRows + row) * 3 + s) * b_columns_;
  }

  /// Adds the plane points of the slots to the matrix.
  void flush() {
    if (filled_ == 0) return;
    const int np = p_.plane_nodes, rows = 3 * filled_, vectors = (np + kLanes - 1) / kLanes;
    if (!begun_) {
      std::memset(matrix_, 0, sizeof(double) * static_cast<std::size_t>(left_ - matrix_));
      begun_ = true;
    }
    double* k = matrix_;
    for (int m = 0; m < m_; ++m) {
      const int n = columns(m), left_stride = n + kPad;
      for (int row = 0; row < rows; ++row) {
        const double *const gu = plane_rows_[row - row % 3], *const gv = gu + p_.padded_plane_nodes,
                            *const gw = gv + p_.padded_plane_nodes;
        const double *b0 = b_at(m, row, 0), *b1 = b_at(m, row, 1), *b2 = b_at(m, row, 2);
        double* to = left_ + static_cast<std::size_t>(row) * left_stride;
        for (int e = m; e < m_; ++e, to += np)
          for (int v = 0; v < vectors; ++v) {
            Lanes g0, g1, g2;
            std::memcpy(&g0, gu + v * kLanes, sizeof g0);
            std::memcpy(&g1, gv + v * kLanes, sizeof g1);
            std::memcpy(&g2, gw + v * kLanes, sizeof g2);
            const Lanes sum = b0[e] * g0 + b1[e] * g1 + b2[e] * g2;
            std::memcpy(to + v * kLanes, &sum, sizeof sum);
          }
        // The padding columns belong to nobody, but must be numbers.
        for (const double* const end = left_ + static_cast<std::size_t>(row) * left_stride + n; to < end;
             ++to)
          *to = 0;
      }
      if (np % 5 == 0)
        multiply<5>(rows, n, left_stride, k);
      else
        multiply<3>(rows, n, left_stride, k);
      k += static_cast<std::size_t>(np) * n;
    }
    filled_ = 0;
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
  const int m_, b_columns_;
  double *matrix_, *left_, *b_;
  const double* plane_rows_[kRows] = {};  ///< of the slots
  double a_[kMaxLinePoints][54];  ///< upper component blocks of the current plane point, by line point
  int plane_point_ = -1, filled_ = 0;
  bool begun_ = false;
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
  bool finish(double* dense) { return is_product_ ? product_.finish(dense) : blocks_.finish(dense); }

 private:
  bool is_product_;
  ProductHessian product_;
  HessianBlocks<3> blocks_;
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
