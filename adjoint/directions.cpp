#include "adjoint/directions.h"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

/// Singular values below this part of the largest are zero within the accuracy of the tangent sweep.
constexpr double kNullTolerance = 1e-8;
/// A direction with more than this part of its length along null vectors is open.
constexpr double kOpen = 1e-6;
/// Components of a direction below this part of its largest one are left out of sentences.
constexpr double kMentioned = 0.3;
/// And so are all beyond this many; the sentence then says how many they are.
constexpr std::size_t kMentionedAtMost = 8;

/// The sign of a singular vector is free: makes the largest component of each column from `first` on positive.
void choose_signs(MatrixXd& columns, Eigen::Index first) {
  for (Eigen::Index i = first; i < columns.cols(); ++i) {
    Eigen::Index largest;
    columns.col(i).cwiseAbs().maxCoeff(&largest);
    if (columns(largest, i) < 0) columns.col(i) *= -1;
  }
}

/// Components that are not far below the largest, largest first.
std::vector<int> large_components(const VectorXd& direction) {
  std::vector<int> order(direction.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return std::fabs(direction[a]) > std::fabs(direction[b]); });
  const double least = kMentioned * direction.cwiseAbs().maxCoeff();
  std::erase_if(order, [&](int k) { return std::fabs(direction[k]) < least; });
  return order;
}

}  // namespace

MatrixXd Directions::basis() const {
  return right_vectors.leftCols(rank) * singular_values.head(rank).cwiseInverse().asDiagonal();
}

bool Directions::is_open(const VectorXd& g) const {
  const VectorXd null_part = right_vectors.rightCols(right_vectors.cols() - rank).transpose() * g;
  return null_part.size() > 0 && null_part.cwiseAbs().maxCoeff() > kOpen * g.norm();
}

Directions directions_of(const MatrixXd& jacobian) {
  const Eigen::Index n = jacobian.cols();
  require(jacobian.rows() >= n && jacobian.allFinite(), "directions_of: Jacobian is wide or not finite");
  Directions d;
  if (n == 0) return d;
  const Eigen::JacobiSVD<MatrixXd> svd(jacobian, Eigen::ComputeThinV);
  d.singular_values = svd.singularValues();
  d.right_vectors = svd.matrixV();
  choose_signs(d.right_vectors, 0);
  while (d.rank < n && d.singular_values[d.rank] > kNullTolerance * d.singular_values[0]) ++d.rank;
  return d;
}

bool lead_null_space(Directions& d, const VectorXd& direction) {
  const Eigen::Index n = d.right_vectors.cols(), count = n - d.rank;
  const double length = direction.norm();
  if (count == 0 || !(length > 0)) return false;
  const MatrixXd null_vectors = d.right_vectors.rightCols(count);
  const VectorXd inside = null_vectors.transpose() * direction;
  if ((null_vectors * inside - direction).norm() > kOpen * length) return false;
  // The first column of Q is the direction, up to its sign; the others complete the basis.
  MatrixXd first = MatrixXd::Identity(count, count);
  first.col(0) = inside / inside.norm();
  if (count > 1) {
    Eigen::Index largest;
    inside.cwiseAbs().maxCoeff(&largest);
    if (largest != 0) first.col(largest) = VectorXd::Unit(count, 0);
  }
  MatrixXd Q = Eigen::HouseholderQR<MatrixXd>(first).householderQ();
  d.right_vectors.rightCols(count) = null_vectors * Q;
  choose_signs(d.right_vectors, d.rank);
  return true;
}

std::vector<int> named_components(const VectorXd& direction) {
  std::vector<int> named = large_components(direction);
  if (named.size() > kMentionedAtMost) named.resize(kMentionedAtMost);
  return named;
}

std::string direction_in_words(const VectorXd& direction, const std::vector<std::string>& names) {
  const std::vector<int> named = named_components(direction);
  std::string up, down;
  for (const int k : named) {
    std::string& list = direction[k] > 0 ? up : down;
    list += (list.empty() ? "" : ", ") + names[k];
  }
  const std::size_t more = large_components(direction).size() - named.size();
  if (more > 0) (down.empty() ? up : down) += " and " + std::to_string(more) + " more";
  if (named.size() == 1) return up + " is not determined: changing it";
  if (down.empty()) return up + " go together: raising all of them";
  return up + " trade off against " + down + ": raising the former while lowering the latter";
}

MatrixXd stacked_root(const MatrixXd& A, const MatrixXd& B) {
  const Eigen::Index n = B.cols();
  require(A.size() == 0 || A.cols() == n, "stacked_root: as many columns above as below");
  MatrixXd stacked = MatrixXd::Zero(std::max(n, (A.size() == 0 ? 0 : A.rows()) + B.rows()), n);
  if (A.size() > 0) stacked.topRows(A.rows()) = A;
  stacked.middleRows(A.size() == 0 ? 0 : A.rows(), B.rows()) = B;
  const Eigen::HouseholderQR<MatrixXd> qr(stacked);
  return qr.matrixQR().topRows(n).triangularView<Eigen::Upper>();
}

}  // namespace rhytid::adjoint
