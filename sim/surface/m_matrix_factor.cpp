#include "sim/surface/m_matrix_factor.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>

#include "sim/core/error.h"

namespace rhytid {
namespace {

using SparseMatrix = Eigen::SparseMatrix<double>;

/// order[position] = node, minimum degree.
std::vector<int> fill_reducing_order(int n, const std::vector<WeightedEdge>& edges) {
  std::vector<Eigen::Triplet<double>> pattern;
  pattern.reserve(2 * edges.size() + static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) pattern.emplace_back(i, i, 1.0);
  for (const WeightedEdge& e : edges) {
    pattern.emplace_back(e.i, e.j, 1.0);
    pattern.emplace_back(e.j, e.i, 1.0);
  }
  SparseMatrix matrix(n, n);
  matrix.setFromTriplets(pattern.begin(), pattern.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(matrix, permutation);
  return {permutation.indices().data(), permutation.indices().data() + n};
}

}  // namespace

MMatrixFactor::MMatrixFactor(const VectorXd& slack, const std::vector<WeightedEdge>& edges) {
  const int n = static_cast<int>(slack.size());
  require((slack.array() >= 0).all(), "MMatrixFactor: slack must be >= 0");
  for (const WeightedEdge& e : edges)
    require(e.i >= 0 && e.j >= 0 && e.i < n && e.j < n && e.i != e.j && e.weight > 0,
            "MMatrixFactor: edges must join two different nodes in range with positive weight");
  order_ = fill_reducing_order(n, edges);
  std::vector<int> position(static_cast<std::size_t>(n));
  for (int p = 0; p < n; ++p) position[static_cast<std::size_t>(order_[static_cast<std::size_t>(p)])] = p;

  // Lower triangle in elimination order: below[j] = (row, weight).
  std::vector<std::vector<std::pair<int, double>>> below(static_cast<std::size_t>(n));
  for (const WeightedEdge& e : edges) {
    const auto [lo, hi] =
        std::minmax({position[static_cast<std::size_t>(e.i)], position[static_cast<std::size_t>(e.j)]});
    below[static_cast<std::size_t>(lo)].emplace_back(hi, e.weight);
  }

  // Left-looking, column by column. Column k waits in updates[row] under the next row it has not yet updated.
  VectorXd s(n);
  for (int p = 0; p < n; ++p) s[p] = slack[order_[static_cast<std::size_t>(p)]];
  pivots_.resize(n);
  starts_.assign(1, 0);
  std::vector<std::vector<int>> updates(static_cast<std::size_t>(n)), children(static_cast<std::size_t>(n));
  std::vector<std::size_t> next(static_cast<std::size_t>(n));
  std::vector<double> work(static_cast<std::size_t>(n), 0.0);
  std::vector<int> mark(static_cast<std::size_t>(n), -1), pattern;
  for (int j = 0; j < n; ++j) {
    const auto column = static_cast<std::size_t>(j);
    pattern.clear();
    const auto visit = [&](int row) {
      if (row == j || mark[static_cast<std::size_t>(row)] == j) return;
      mark[static_cast<std::size_t>(row)] = j;
      pattern.push_back(row);
    };
    for (const auto& [row, weight] : below[column]) {
      visit(row);
      work[static_cast<std::size_t>(row)] += weight;
    }
    for (const int child : children[column])
      for (std::size_t k = starts_[static_cast<std::size_t>(child)];
           k < starts_[static_cast<std::size_t>(child) + 1]; ++k)
        visit(rows_[k]);
    for (const int k : updates[column]) {
      const std::size_t end = starts_[static_cast<std::size_t>(k) + 1];
      std::size_t& at = next[static_cast<std::size_t>(k)];
      const double factor = values_[at] / pivots_[k];
      ++at;
      for (std::size_t m = at; m < end; ++m) work[static_cast<std::size_t>(rows_[m])] += factor * values_[m];
      if (at < end) updates[static_cast<std::size_t>(rows_[at])].push_back(k);
    }
    updates[column] = {};

    std::sort(pattern.begin(), pattern.end());
    double pivot = s[j];
    for (const int row : pattern) {
      double& value = work[static_cast<std::size_t>(row)];
      rows_.push_back(row);
      values_.push_back(value);
      pivot += value;
      value = 0;
    }
    starts_.push_back(rows_.size());
    pivots_[j] = pivot;
    for (std::size_t k = starts_[column]; k < starts_[column + 1]; ++k)
      s[rows_[k]] += values_[k] / pivot * s[j];
    next[column] = starts_[column];
    if (!pattern.empty()) {
      updates[static_cast<std::size_t>(pattern.front())].push_back(j);
      children[static_cast<std::size_t>(pattern.front())].push_back(j);
    }
    require(pivot > 0 || (children[column].empty() && below[column].empty()),
            "MMatrixFactor: a connected component has no slack");
  }
}

MatrixXd MMatrixFactor::solve(const MatrixXd& rhs) const {
  const Eigen::Index n = pivots_.size();
  require(rhs.rows() == n, "MMatrixFactor: right-hand side has the wrong number of rows");
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> x(n, rhs.cols());
  for (Eigen::Index p = 0; p < n; ++p) x.row(p) = rhs.row(order_[static_cast<std::size_t>(p)]);
  for (Eigen::Index j = 0; j < n; ++j) {
    const auto column = static_cast<std::size_t>(j);
    for (std::size_t k = starts_[column]; k < starts_[column + 1]; ++k)
      x.row(rows_[k]) += (values_[k] / pivots_[j]) * x.row(j);
  }
  for (Eigen::Index j = n - 1; j >= 0; --j) {
    const auto column = static_cast<std::size_t>(j);
    for (std::size_t k = starts_[column]; k < starts_[column + 1]; ++k)
      x.row(j) += values_[k] * x.row(rows_[k]);
    if (pivots_[j] > 0)
      x.row(j) /= pivots_[j];
    else
      x.row(j).setZero();
  }
  MatrixXd result(n, rhs.cols());
  for (Eigen::Index p = 0; p < n; ++p) result.row(order_[static_cast<std::size_t>(p)]) = x.row(p);
  return result;
}

}  // namespace rhytid
