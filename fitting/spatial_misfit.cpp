#include "fitting/spatial_misfit.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// Matrices of all pairs of tracks are kept: with so many they take some hundred MB.
constexpr std::size_t kMostTracks = 1500;
/// Residuals are compared up to this part of the largest distance; farther pairs are few and at the rims.
constexpr double kFarthest = 0.6;
constexpr int kBins = 12;  ///< of that distance

/// Eigen shares large products between threads in an order that depends on their number; ours must not.
class OneThread {
 public:
  OneThread() : before_(Eigen::nbThreads()) { Eigen::setNbThreads(1); }
  ~OneThread() { Eigen::setNbThreads(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_;
};

MatrixXd gaussian(const MatrixXd& distances, double length) {
  return (-0.5 * (distances.array() / length).square()).exp().matrix();
}

struct Distances {
  MatrixXd all;
  double largest = 0;  ///< within clips
};

/// Between clips so far that no field and no kernel reaches.
Distances distances_of(const std::vector<const WhitenedTrack*>& tracks) {
  const auto n = static_cast<Eigen::Index>(tracks.size());
  Distances d{MatrixXd::Zero(n, n)};
  const auto within = [&](Eigen::Index i, Eigen::Index j) { return tracks[i]->clip == tracks[j]->clip; };
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      if (within(i, j)) d.all(i, j) = (tracks[i]->place - tracks[j]->place).norm();
  d.largest = n > 0 ? d.all.maxCoeff() : 0;
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      if (!within(i, j)) d.all(i, j) = 1e3 * d.largest;
  return d;
}

/// Typical distance to the nearest other track.
double spacing_of(const MatrixXd& distances, double farthest) {
  std::vector<double> nearest;
  for (Eigen::Index i = 0; i < distances.rows(); ++i) {
    double least = farthest;
    for (Eigen::Index j = 0; j < distances.cols(); ++j)
      if (distances(i, j) > 0) least = std::min(least, distances(i, j));
    nearest.push_back(least);
  }
  std::nth_element(nearest.begin(), nearest.begin() + nearest.size() / 2, nearest.end());
  return nearest[nearest.size() / 2];
}

/// Lengths from `first` to at most `last`, at least one, each `factor` times the one before.
std::vector<double> lengths(double first, double last, double factor) {
  std::vector<double> list = {first};
  while (list.back() * factor <= last) list.push_back(list.back() * factor);
  return list;
}

/// argmin |A x − b| with x >= 0, by coordinate descent: a convex problem of a dozen unknowns.
VectorXd non_negative_least_squares(const MatrixXd& a, const VectorXd& b) {
  const MatrixXd normal = a.transpose() * a;
  const VectorXd rhs = a.transpose() * b;
  VectorXd x = VectorXd::Zero(a.cols());
  for (int round = 0; round < 20000; ++round) {
    double change = 0;
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      if (!(normal(k, k) > 0)) continue;
      const double next = std::max(0.0, x[k] + (rhs[k] - normal.row(k).dot(x)) / normal(k, k));
      change = std::max(change, std::fabs(next - x[k]));
      x[k] = next;
    }
    if (change <= 1e-9 * x.maxCoeff()) break;
  }
  return x;
}

/// Row `track` of a matrix of flattened square ones.
MatrixXd unflattened(const MatrixXd& all, Eigen::Index track, Eigen::Index rank) {
  return all.row(track).reshaped(rank, rank);
}

}  // namespace

SpatialMisfit::SpatialMisfit(const std::vector<WhitenedTrack>& tracks, const MatrixXd& basis)
    : rank_(basis.cols()), covariance_(MatrixXd::Zero(basis.cols(), basis.cols())) {
  const OneThread one_thread;
  const std::size_t every = (tracks.size() + kMostTracks - 1) / kMostTracks;
  std::vector<const WhitenedTrack*> used;
  int num_rows = 0;
  for (std::size_t i = 0; i < tracks.size(); i += every) {
    const WhitenedTrack& t = tracks[i];
    require(t.jacobian.rows() == static_cast<Eigen::Index>(t.rows.size()) &&
                t.residuals.size() == t.jacobian.rows() && t.jacobian.cols() == basis.rows(),
            "SpatialMisfit: rows and parameters of a track");
    used.push_back(&t);
    for (const int row : t.rows) num_rows = std::max(num_rows, row + 1);
  }
  const auto n = static_cast<Eigen::Index>(used.size());
  const Distances distances = distances_of(used);
  if (rank_ == 0 || n <= rank_ || !(distances.largest > 0)) return;

  // Of fewer tracks A is not 1: their coordinates are own ones.
  to_own_ = MatrixXd::Identity(rank_, rank_);
  if (every > 1) {
    MatrixXd normal = MatrixXd::Zero(rank_, rank_);
    for (const WhitenedTrack* t : used) {
      const MatrixXd j = t->jacobian * basis;
      normal += j.transpose() * j;
    }
    const Eigen::LLT<MatrixXd> factor(normal);
    if (factor.info() != Eigen::Success) return;
    to_own_ = factor.matrixU().solve(to_own_).eval();
  }
  jacobian_ = MatrixXd::Zero(n, num_rows * rank_);
  residuals_ = seen_ = MatrixXd::Zero(n, num_rows);
  for (Eigen::Index i = 0; i < n; ++i) {
    const MatrixXd j = used[i]->jacobian * basis * to_own_;
    for (std::size_t k = 0; k < used[i]->rows.size(); ++k) {
      const int row = used[i]->rows[k];
      jacobian_.block(i, row * rank_, 1, rank_) = j.row(k);
      residuals_(i, row) = used[i]->residuals[k];
      seen_(i, row) = 1;
    }
  }
  fit_reference(distances.all, distances.largest);
  choose_kernel(distances.all, distances.largest);
}

MatrixXd SpatialMisfit::smoothed_jacobian(const MatrixXd& weights) const {
  MatrixXd out = weights * jacobian_;
  for (Eigen::Index row = 0; row < seen_.cols(); ++row)
    out.middleCols(row * rank_, rank_).array().colwise() *= seen_.col(row).array();
  return out;
}

MatrixXd SpatialMisfit::weighted_normal(const MatrixXd& weights) const {
  const MatrixXd smoothed = weights * jacobian_;
  MatrixXd sum = MatrixXd::Zero(rank_, rank_);
  for (Eigen::Index row = 0; row < seen_.cols(); ++row)
    sum += jacobian_.middleCols(row * rank_, rank_).transpose() * smoothed.middleCols(row * rank_, rank_);
  return sum;
}

void SpatialMisfit::fit_reference(const MatrixXd& distances, double largest) {
  const Eigen::Index n = distances.rows();
  const double spacing = spacing_of(distances, largest);
  // The diagonal, then rings of distances.
  Eigen::MatrixXi bin = (distances * (kBins / (kFarthest * largest))).cast<int>().array() + 1;
  bin.diagonal().setZero();
  const auto summed = [&](const MatrixXd& products) {
    VectorXd sums = VectorXd::Zero(kBins + 1);
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j)
        if (bin(j, i) <= kBins) sums[bin(j, i)] += products(j, i);
    return sums;
  };
  const MatrixXd together = seen_ * seen_.transpose();
  // Per pair, the products of M Σ M over the frames in which both are seen.
  const auto expected = [&](const MatrixXd& weights) -> MatrixXd {
    const MatrixXd smoothed = smoothed_jacobian(weights), sum = weighted_normal(weights);
    const MatrixXd cross = smoothed * jacobian_.transpose();
    MatrixXd turned = jacobian_;
    for (Eigen::Index row = 0; row < seen_.cols(); ++row)
      turned.middleCols(row * rank_, rank_) = jacobian_.middleCols(row * rank_, rank_) * sum;
    return weights.cwiseProduct(together) - cross - cross.transpose() + turned * jacobian_.transpose();
  };
  std::vector<MatrixXd> parts = {MatrixXd::Identity(n, n)};
  for (const double length : lengths(0.7 * spacing, 0.5 * largest, 1.5))
    parts.push_back(gaussian(distances, length));
  const VectorXd weight = summed(together).cwiseMax(1).cwiseSqrt().cwiseInverse();
  MatrixXd by_part(kBins + 1, parts.size());
  for (std::size_t k = 0; k < parts.size(); ++k)
    by_part.col(k) = weight.cwiseProduct(summed(expected(parts[k])));
  const VectorXd found = weight.cwiseProduct(summed(residuals_ * residuals_.transpose()));
  VectorXd shares = non_negative_least_squares(by_part, found);
  if (!(shares.maxCoeff() > 0)) shares[0] = 1;
  reference_ = MatrixXd::Zero(n, n);
  for (std::size_t k = 0; k < parts.size(); ++k) reference_ += shares[k] * parts[k];
  reference_sum_ = weighted_normal(reference_);
  const MatrixXd smoothed = smoothed_jacobian(reference_);
  own_ = neighbour_ = MatrixXd::Zero(n, rank_ * rank_);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto mine = jacobian_.row(i).reshaped(rank_, seen_.cols());
    own_.row(i) = (mine * mine.transpose()).reshaped();
    neighbour_.row(i) = (smoothed.row(i).reshaped(rank_, seen_.cols()) * mine.transpose()).reshaped();
  }
}

MatrixXd SpatialMisfit::expected_sum(const MatrixXd& kernel) const {
  const MatrixXd around = kernel * own_;  // Σ_i K_ij A_i
  MatrixXd cross = MatrixXd::Zero(rank_, rank_), both = cross;
  for (Eigen::Index j = 0; j < kernel.rows(); ++j) {
    const MatrixXd a = unflattened(around, j, rank_);
    cross += a * unflattened(neighbour_, j, rank_);
    both += a * reference_sum_ * unflattened(own_, j, rank_);
  }
  const MatrixXd sum = weighted_normal(kernel.cwiseProduct(reference_)) - cross - cross.transpose() + both;
  return 0.5 * (sum + sum.transpose());
}

void SpatialMisfit::choose_kernel(const MatrixXd& distances, double largest) {
  double least = std::numeric_limits<double>::infinity();
  MatrixXd expected;
  for (const double length : lengths(0.7 * spacing_of(distances, largest), kFarthest * largest, 1.25)) {
    const MatrixXd kernel = gaussian(distances, length);
    const MatrixXd sum = expected_sum(kernel);
    const Eigen::LLT<MatrixXd> factor(sum);
    if (factor.info() != Eigen::Success) continue;
    const double needed = factor.solve(reference_sum_).trace();
    if (!(needed < least)) continue;
    least = needed;
    kernel_width_ = length;
    kernel_ = kernel;
    expected = sum;
  }
  if (kernel_width_ == 0) return;
  // B_0 v = λ E v with VᵀEV = 1: then C = V⁻ᵀ √Λ Vᵀ.
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> pair(reference_sum_, expected);
  const MatrixXd& v = pair.eigenvectors();
  correction_ =
      v.transpose().inverse() * pair.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * v.transpose();
  MatrixXd scores = MatrixXd::Zero(kernel_.rows(), rank_);
  for (Eigen::Index row = 0; row < seen_.cols(); ++row)
    scores += residuals_.col(row).asDiagonal() * jacobian_.middleCols(row * rank_, rank_);
  const MatrixXd root = to_own_ * correction_;
  covariance_ = root * (scores.transpose() * kernel_ * scores) * root.transpose();
  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
}

double SpatialMisfit::degrees(const VectorXd& g) const {
  require(g.size() == rank_, "SpatialMisfit: a direction by the coordinates");
  if (kernel_width_ == 0) return 1;
  const OneThread one_thread;
  const VectorXd d = correction_.transpose() * (to_own_.transpose() * g);
  const Eigen::Index n = kernel_.rows();
  MatrixXd effect(n, seen_.cols()), own(n, rank_), neighbour(n, rank_);
  for (Eigen::Index row = 0; row < seen_.cols(); ++row)
    effect.col(row) = jacobian_.middleCols(row * rank_, rank_) * d;
  for (Eigen::Index i = 0; i < n; ++i) {
    own.row(i) = unflattened(own_, i, rank_) * d;
    neighbour.row(i) = unflattened(neighbour_, i, rank_) * d;
  }
  // dᵀ E[s_i s_jᵀ] d; the variance is the sum of its product with K, so of its eigenvalues times χ²_1.
  const MatrixXd cross = own * neighbour.transpose();
  const MatrixXd products = reference_.cwiseProduct(effect * effect.transpose()) - cross - cross.transpose() +
                            own * reference_sum_ * own.transpose();
  const MatrixXd all = kernel_ * products;
  const double mean = all.trace(), variance = all.cwiseProduct(all.transpose()).sum();
  return variance > 0 ? std::max(1.0, mean * mean / variance) : 1;
}

}  // namespace rhytid::fitting
