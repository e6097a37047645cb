#include "sim/solve/block_matrix.h"

#include <algorithm>

#include "sim/core/error.h"
#include "sim/solve/block_pattern_impl.h"

namespace rhytid {

namespace {

/// y += A x in the factor's order, from the lower triangle: the rows of three columns at once, run by run of rows that
/// follow each other (mostly a column of nodes through the skin and its neighbours).
[[gnu::always_inline]] inline void add_product_by_runs(const BlockPattern::Impl& p, const double* values,
                                                       const double* __restrict x, double* __restrict y) {
  const int* const rows = p.block_rows.data();
  for (int column = 0; column < p.num_blocks; ++column) {
    const double* v0 = values + p.value_start[column];
    const std::ptrdiff_t length = p.column_length[column];
    // Columns 1 and 2 lack the entries above the diagonal.
    const double *v1 = v0 + length - 1, *v2 = v0 + 2 * length - 3;
    const int own = 3 * column;
    const double x0 = x[own], x1 = x[own + 1], x2 = x[own + 2];
    double s0 = v0[0] * x0 + v0[1] * x1 + v0[2] * x2, s1 = v0[1] * x0 + v1[1] * x1 + v1[2] * x2,
           s2 = v0[2] * x0 + v1[2] * x1 + v2[2] * x2;
    const int end = p.block_row_start[column + 1];
    for (int e = p.block_row_start[column] + 1, next = e; e < end; e = next) {
      for (next = e + 1; next < end && rows[next] == rows[next - 1] + 1;) ++next;
      const std::ptrdiff_t at = 3 * static_cast<std::ptrdiff_t>(e - p.block_row_start[column]),
                           count = 3 * (next - e);
      const double *a0 = v0 + at, *a1 = v1 + at, *a2 = v2 + at, *from = x + 3 * rows[e];
      double* const to = y + 3 * rows[e];
#pragma omp simd reduction(+ : s0, s1, s2)
      for (std::ptrdiff_t i = 0; i < count; ++i) {
        to[i] += a0[i] * x0 + a1[i] * x1 + a2[i] * x2;
        s0 += a0[i] * from[i];
        s1 += a1[i] * from[i];
        s2 += a2[i] * from[i];
      }
    }
    y[own] += s0;
    y[own + 1] += s1;
    y[own + 2] += s2;
  }
}

#if defined(__x86_64__)
__attribute__((target("avx2,fma"))) void add_product_avx2(const BlockPattern::Impl& p, const double* values,
                                                          const double* x, double* y) {
  add_product_by_runs(p, values, x, y);
}
#endif

void add_product(const BlockPattern::Impl& p, const double* values, const double* x, double* y) {
#if defined(__x86_64__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (has_avx2) return add_product_avx2(p, values, x, y);
#endif
  add_product_by_runs(p, values, x, y);
}

}  // namespace

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
  add_product(p, values_.data(), xp.data(), yp.data());
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
