#include "sim/solve/block_matrix.h"

#include <algorithm>

#include "sim/core/error.h"
#include "sim/solve/block_pattern_impl.h"

namespace rhytid {

BlockMatrix::BlockMatrix(const BlockPattern& pattern)
    : pattern_(&pattern), values_(pattern.num_entries(), 0.0) {}

void BlockMatrix::set_zero() {
  std::fill(values_.begin(), values_.end(), 0.0);
}

void BlockMatrix::add(int clique, const double* dense) {
  const BlockPattern::Impl& p = pattern_->impl();
  const std::int64_t first_place = p.clique_place_start[clique];
  const int m = static_cast<int>(p.clique_place_start[clique + 1] - first_place);
  const int* places = p.clique_places.data() + first_place;
  const int* pair = p.clique_pairs.data() + p.clique_pair_start[clique];
  const int* column_length = p.column_length.data();
  double* values = values_.data();
  const std::ptrdiff_t n = 3 * static_cast<std::ptrdiff_t>(m);

  for (int a = 0; a < m; ++a) {
    const int place_a = places[a];
    if (place_a < 0) {
      pair += a + 1;
      continue;
    }
    const double* rows = dense + 3 * a * n;
    for (int b = 0; b < a; ++b, ++pair) {
      const int place_b = places[b];
      if (place_b < 0) continue;
      // Node b's column unless node a comes first in the order; then the block is transposed. Which of the
      // two is as good as random, hence strides instead of a branch.
      const bool transposed = place_a < place_b;
      const std::ptrdiff_t row_step = transposed ? 1 : n, column_step = transposed ? n : 1;
      const double* d = rows + 3 * b;
      const std::ptrdiff_t length = column_length[transposed ? place_a : place_b];
      double* v0 = values + *pair;
      double* v1 = v0 + length - 1;
      double* v2 = v0 + 2 * length - 3;
      v0[0] += d[0];
      v0[1] += d[row_step];
      v0[2] += d[2 * row_step];
      d += column_step;
      v1[0] += d[0];
      v1[1] += d[row_step];
      v1[2] += d[2 * row_step];
      d += column_step;
      v2[0] += d[0];
      v2[1] += d[row_step];
      v2[2] += d[2 * row_step];
    }
    const double* d = rows + 3 * a;
    const std::ptrdiff_t length = column_length[place_a];
    double* v = values + *pair++;
    v[0] += d[0];
    v[1] += d[n];
    v[2] += d[2 * n];
    v[length] += d[n + 1];
    v[length + 1] += d[2 * n + 1];
    v[2 * length - 1] += d[2 * n + 2];
  }
}

void BlockMatrix::fix(int unknown) {
  const BlockPattern::Impl& p = pattern_->impl();
  require(unknown >= 0 && unknown < 3 * p.num_blocks, "BlockMatrix::fix: unknown out of range");
  const int place = p.position[unknown / 3], r = unknown % 3, scalar = 3 * place + r;
  std::fill(values_.begin() + p.scalar_column_start[scalar],
            values_.begin() + p.scalar_column_start[scalar + 1], 0.0);
  for (int e = p.left_start[place]; e < p.left_start[place + 1]; ++e) {
    double* v = values_.data() + p.left_value[e] + r;
    const std::ptrdiff_t length = p.column_length[p.left_column[e]];
    v[0] = v[length - 1] = v[2 * length - 3] = 0;
  }
  // The entries of the same row in the earlier columns of the diagonal block.
  for (int c = 0; c < r; ++c) values_[p.scalar_column_start[3 * place + c] + r - c] = 0;
  values_[p.scalar_column_start[scalar]] = 1;
}

VectorXd BlockMatrix::multiply(const VectorXd& x) const {
  const BlockPattern::Impl& p = pattern_->impl();
  require(x.size() == 3 * p.num_blocks, "BlockMatrix::multiply: wrong vector size");
  VectorXd xp(x.size()), yp = VectorXd::Zero(x.size()), y(x.size());
  for (int b = 0; b < p.num_blocks; ++b) xp.segment<3>(3 * p.position[b]) = x.segment<3>(3 * b);
  for (int column = 0; column < p.num_blocks; ++column) {
    const double* v = values_.data() + p.value_start[column];
    const std::ptrdiff_t length = p.column_length[column];
    const Vec3 xc = xp.segment<3>(3 * column);
    Mat3 block;
    block << v[0], v[1], v[2], v[1], v[length], v[length + 1], v[2], v[length + 1], v[2 * length - 1];
    Vec3 sum = block * xc;
    for (int e = p.block_row_start[column] + 1; e < p.block_row_start[column + 1]; ++e) {
      v += 3;
      const int row = 3 * p.block_rows[e];
      block.col(0) = Eigen::Map<const Vec3>(v);
      block.col(1) = Eigen::Map<const Vec3>(v + length - 1);
      block.col(2) = Eigen::Map<const Vec3>(v + 2 * length - 3);
      yp.segment<3>(row) += block * xc;
      sum += block.transpose() * xp.segment<3>(row);
    }
    yp.segment<3>(3 * column) += sum;
  }
  for (int b = 0; b < p.num_blocks; ++b) y.segment<3>(3 * b) = yp.segment<3>(3 * p.position[b]);
  return y;
}

double BlockMatrix::diagonal_max() const {
  const BlockPattern::Impl& p = pattern_->impl();
  double result = values_[0];
  for (int i = 0; i < 3 * p.num_blocks; ++i) result = std::max(result, values_[p.scalar_column_start[i]]);
  return result;
}

}  // namespace rhytid
