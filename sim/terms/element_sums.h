// The sums over an element's nodes and points that every law shares: nodal values to points, point values to
// nodes, point blocks to the element matrix. They know no physics.
//
// Shapes   tables and views as in kinematics.h (ElementView); R rows per point: 3 on prisms, 1 on surfaces.
// Tests    tests/sim/terms/term_kernels_test.cpp
#pragma once

#include <cstring>

#include "sim/math/lanes.h"
#include "sim/math/multiply_add.h"
#include "sim/terms/kinematics.h"

namespace rhytid {
inline namespace RHYTID_ISA {

inline constexpr int kMaxRows = 3 * 200;  ///< nq·R at most, a multiple of 8

/// Vectors of the tiles below; rows and nodes are padded to multiples of 8.
inline constexpr int kSumTile = kLanes == 8 ? 1 : 2;

/// natural[a][row] = Σ_i u[i][a] table[row][i]. Rows are written up to the next multiple of 8.
template <int R>
void gather(const ElementView& v, const double* u, double (*natural)[kMaxRows]) {
  constexpr int tile = kSumTile * kLanes;
  const int rows = v.num_points * R;
  for (int k = 0; k < rows; k += tile) {
    Lanes sum[3][kSumTile] = {};
    for (int i = 0; i < v.num_nodes; ++i) {
      const double* t = v.rows_by_node + static_cast<std::size_t>(i) * v.padded_rows + k;
      Lanes table[kSumTile];
      for (int s = 0; s < kSumTile; ++s) std::memcpy(&table[s], t + s * kLanes, sizeof(Lanes));
      for (int a = 0; a < 3; ++a)
        for (int s = 0; s < kSumTile; ++s) sum[a][s] += u[3 * i + a] * table[s];
    }
    for (int a = 0; a < 3; ++a) std::memcpy(natural[a] + k, sum[a], sizeof sum[a]);
  }
}

/// f[i][a] += Σ_row natural[a][row] table[row][i].
template <int R>
void scatter(const ElementView& v, const double (*natural)[kMaxRows], double* f) {
  constexpr int tile = kSumTile * kLanes;
  const int rows = v.num_points * R;
  for (int i = 0; i < v.num_nodes; i += tile) {
    Lanes sum[3][kSumTile] = {};
    for (int k = 0; k < rows; ++k) {
      const double* t = v.node_by_row + static_cast<std::size_t>(k) * v.padded_nodes + i;
      Lanes table[kSumTile];
      for (int s = 0; s < kSumTile; ++s) std::memcpy(&table[s], t + s * kLanes, sizeof(Lanes));
      for (int a = 0; a < 3; ++a)
        for (int s = 0; s < kSumTile; ++s) sum[a][s] += natural[a][k] * table[s];
    }
    const int count = v.num_nodes - i < tile ? v.num_nodes - i : tile;
    for (int j = 0; j < count; ++j)
      for (int a = 0; a < 3; ++a) f[3 * (i + j) + a] += sum[a][j / kLanes][j % kLanes];
  }
}

/// For directions k … k + kLanes − 1 of kDirections at point q: local[a·R + r] = Σ_i du[i][a][k] table[q·R + r][i].
template <int R>
void gather_directions(const ElementView& v, const double* du, int q, int k, Lanes* local) {
  for (int z = 0; z < 3 * R; ++z) local[z] = Lanes{};
  for (int i = 0; i < v.num_nodes; ++i) {
    Lanes node[3];
    for (int a = 0; a < 3; ++a)
      std::memcpy(&node[a], du + (3 * static_cast<std::size_t>(i) + a) * kDirections + k, sizeof(Lanes));
    for (int r = 0; r < R; ++r) {
      const double t = v.node_by_row[static_cast<std::size_t>(q * R + r) * v.padded_nodes + i];
      for (int a = 0; a < 3; ++a) local[a * R + r] += t * node[a];
    }
  }
}

/// The transpose: adds to df[n][3][kDirections].
template <int R>
void scatter_directions(const ElementView& v, const Lanes* local, int q, int k, double* df) {
  for (int i = 0; i < v.num_nodes; ++i) {
    double* const at = df + 3 * static_cast<std::size_t>(i) * kDirections + k;
    Lanes node[3];
    for (int a = 0; a < 3; ++a) std::memcpy(&node[a], at + a * kDirections, sizeof(Lanes));
    for (int r = 0; r < R; ++r) {
      const double t = v.node_by_row[static_cast<std::size_t>(q * R + r) * v.padded_nodes + i];
      for (int a = 0; a < 3; ++a) node[a] += t * local[a * R + r];
    }
    for (int a = 0; a < 3; ++a) std::memcpy(at + a * kDirections, &node[a], sizeof(Lanes));
  }
}

/// Element matrix Σ_q Gᵀ A_q G from point blocks A_q [3R][3R] in natural directions, weight included. Points
/// are collected until a pass of the dense product is worth while.
template <int R>
class HessianBlocks {
 public:
  /// `work` holds hessian_work_size() doubles.
  HessianBlocks(const ElementView& v, double* work)
      : v_(v),
        blocks_(work),
        left_(work + 6 * static_cast<std::size_t>(v.padded_nodes) * v.padded_nodes),
        table_(left_ + 6 * static_cast<std::size_t>(kHessianRows) * v.padded_nodes) {}

  /// Point q's block; consecutive entries lie `stride` apart (lanes of a pack).
  void add(int q, const double* a, int stride) {
    const int n8 = v_.padded_nodes;
    if (!any_) {
      std::memset(blocks_, 0, sizeof(double) * 6 * static_cast<std::size_t>(n8) * n8);
      any_ = true;
    }
    const double* table = v_.node_by_row + static_cast<std::size_t>(q) * R * n8;
    std::memcpy(table_ + static_cast<std::size_t>(filled_) * n8, table,
                sizeof(double) * R * static_cast<std::size_t>(n8));
    int block = 0;
    for (int ca = 0; ca < 3; ++ca)
      for (int cb = ca; cb < 3; ++cb, ++block)
        for (int r = 0; r < R; ++r) {
          double* row = left_ + (static_cast<std::size_t>(block) * kHessianRows + filled_ + r) * n8;
          double factor[R];
          for (int s = 0; s < R; ++s) factor[s] = a[((ca * R + r) * 3 * R + cb * R + s) * stride];
          for (int j = 0; j < n8; ++j) {
            double sum = factor[0] * table[j];
            for (int s = 1; s < R; ++s) sum += factor[s] * table[s * n8 + j];
            row[j] = sum;
          }
        }
    filled_ += R;
    if (filled_ == kHessianRows) flush();
  }

  /// Dense [3n][3n], node-major, full. False, and nothing written, when no point was added.
  bool finish(double* dense) {
    if (!any_) return false;
    if (filled_) flush();
    const int n = v_.num_nodes, n3 = 3 * n, n8 = v_.padded_nodes;
    int block = 0;
    for (int a = 0; a < 3; ++a)
      for (int b = a; b < 3; ++b, ++block) {
        const double* k = blocks_ + static_cast<std::size_t>(block) * n8 * n8;
        for (int i = 0; i < n; ++i)
          for (int j = a == b ? i : 0; j < n; ++j) {
            const double value = k[static_cast<std::size_t>(i) * n8 + j];
            dense[static_cast<std::size_t>(3 * i + a) * n3 + 3 * j + b] = value;
            dense[static_cast<std::size_t>(3 * j + b) * n3 + 3 * i + a] = value;
          }
      }
    return true;
  }

 private:
  void flush() {
    const int n8 = v_.padded_nodes;
    int block = 0;
    for (int a = 0; a < 3; ++a)
      for (int b = a; b < 3; ++b, ++block)
        multiply_add(table_, left_ + static_cast<std::size_t>(block) * kHessianRows * n8, filled_, n8, a == b,
                     blocks_ + static_cast<std::size_t>(block) * n8 * n8);
    filled_ = 0;
  }

  const ElementView& v_;
  double* blocks_;  // 6 blocks (a ≤ b) [npad][npad]
  double* left_;    // 6 × [kHessianRows][npad]
  double* table_;   // [kHessianRows][npad]
  int filled_ = 0;
  bool any_ = false;
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
