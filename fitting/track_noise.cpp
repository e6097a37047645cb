#include "fitting/track_noise.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// L^{−1} with covariance = L Lᵀ.
Eigen::Matrix2d inverse_root(const Eigen::Matrix2d& covariance) {
  const Eigen::LLT<Eigen::Matrix2d> factor(covariance);
  require(factor.info() == Eigen::Success && covariance.allFinite(),
          "TrackNoise: covariance is not positive definite");
  return factor.matrixL().solve(Eigen::Matrix2d::Identity());
}

/// Weight ρ'(s) of Huber's loss for a residual of `length` standard deviations.
double huber_weight(double length, double k) {
  return k <= 0 || length <= k ? 1 : k / length;
}

/// √(ρ(s)/s): a residual times this has ρ(s) as its square.
double huber_root(double length, double k) {
  return k <= 0 || length <= k ? 1 : std::sqrt(k * (2 * length - k)) / length;
}

}  // namespace

TrackNoise::TrackNoise(const Eigen::Matrix2d& first, const std::vector<Eigen::Matrix2d>& later, double huber,
                       const std::vector<Renewal>& renewals)
    : shift_covariances_({first}), huber_(huber) {
  build(later, renewals);
}

TrackNoise::TrackNoise(const Track& track, const std::vector<const Observation*>& used, double floor,
                       double huber, const TrackWeights& weights)
    : huber_(huber) {
  require(weights.frames.empty() || weights.frames.size() == used.size(), "TrackNoise: a weight for each");
  std::vector<Eigen::Matrix2d> later;
  std::vector<Renewal> renewals;
  const Observation* last = nullptr;  // the last ok one
  auto next = used.begin();
  for (const Observation& o : track.observations) {
    if (o.status != TrackStatus::ok) continue;
    if (last == nullptr) shift_covariances_.push_back(with_floor(o.covariance, floor) / weights.whole);
    if (last != nullptr && o.renewed)
      renewals.push_back({static_cast<int>(later.size()), last->covariance / weights.whole});
    if (last != nullptr && next != used.end() && *next == &o) {
      const double weight = weights.frames.empty() ? 1 : weights.frames[later.size()];
      later.push_back(with_floor(o.covariance, floor) / (weight * weights.whole));
      ++next;
    }
    last = &o;
  }
  require(next == used.end() && last != nullptr,
          "TrackNoise: observations used are not later ones of the track");
  // Those behind the last one used shift nothing that is seen.
  std::erase_if(renewals, [&](const Renewal& r) { return r.from == static_cast<int>(later.size()); });
  build(later, renewals);
}

void TrackNoise::build(const std::vector<Eigen::Matrix2d>& later, const std::vector<Renewal>& renewals) {
  require(huber_ >= 0, "TrackNoise: huber must not be negative");
  for (const Eigen::Matrix2d& c : later) roots_.push_back(inverse_root(c));
  shift_of_.assign(later.size(), 0);
  for (const Renewal& r : renewals) {
    require(r.from >= 0 && r.from < static_cast<int>(later.size()),
            "TrackNoise: a renewal outside the frames");
    shift_covariances_.push_back(r.covariance);
    for (std::size_t f = r.from; f < later.size(); ++f) ++shift_of_[f];
  }
  shift_root_ = MatrixXd::Zero(2 * num_shifts(), 2 * num_shifts());
  for (int k = 0; k < num_shifts(); ++k) {
    const Eigen::Matrix2d root = inverse_root(shift_covariances_[k]);
    shift_root_.block<2, 2>(2 * k, 2 * k) = root;
    if (k > 0) shift_root_.block<2, 2>(2 * k, 2 * k - 2) = -root;
  }
}

VectorXd TrackNoise::best_shift(const VectorXd& r, std::vector<double>& weights) const {
  // Iteratively reweighted least squares: every round minimises a quadratic above the convex cost that
  // touches it, so the cost falls monotonically to its only minimum.
  VectorXd shift = VectorXd::Zero(2 * num_shifts());
  weights.assign(roots_.size(), 1.0);
  for (int round = 0; round < 500; ++round) {
    MatrixXd matrix = shift_root_.transpose() * shift_root_;
    VectorXd rhs = VectorXd::Zero(2 * num_shifts());
    for (std::size_t f = 0; f < roots_.size(); ++f) {
      const Eigen::Matrix2d precision = weights[f] * roots_[f].transpose() * roots_[f];
      matrix.block<2, 2>(2 * shift_of_[f], 2 * shift_of_[f]) += precision;
      rhs.segment<2>(2 * shift_of_[f]) += precision * r.segment<2>(2 * f);
    }
    const VectorXd next = matrix.llt().solve(rhs);
    const double change = (next - shift).norm();
    shift = next;
    bool all_full = true;
    for (std::size_t f = 0; f < roots_.size(); ++f) {
      const Vec2 e = r.segment<2>(2 * f) - shift.segment<2>(2 * shift_of_[f]);
      const double weight = huber_weight((roots_[f] * e).norm(), huber_);
      all_full = all_full && weight == 1 && weights[f] == 1;
      weights[f] = weight;
    }
    if (all_full || (round > 0 && change <= 1e-14 * (1 + shift.norm()))) break;
  }
  return shift;
}

TrackNoise::Evaluation TrackNoise::evaluate(const VectorXd& r) const {
  require(r.size() == 2 * num_observations(), "TrackNoise: residual has the wrong size");
  Evaluation out;
  out.shift = best_shift(r, out.weights);
  out.whitened.resize(num_rows());
  out.gradient.resize(r.size());
  for (std::size_t f = 0; f < roots_.size(); ++f) {
    const Vec2 e = roots_[f] * (r.segment<2>(2 * f) - out.shift.segment<2>(2 * shift_of_[f]));
    out.whitened.segment<2>(2 * f) = huber_root(e.norm(), huber_) * e;
    out.gradient.segment<2>(2 * f) = out.weights[f] * roots_[f].transpose() * e;
  }
  out.whitened.tail(2 * num_shifts()) = shift_root_ * out.shift;
  out.cost = 0.5 * out.whitened.squaredNorm();
  return out;
}

MatrixXd TrackNoise::without(const MatrixXd& basis, MatrixXd columns) {
  const MatrixXd q =
      Eigen::HouseholderQR<MatrixXd>(basis).householderQ() * MatrixXd::Identity(basis.rows(), basis.cols());
  columns -= q * (q.transpose() * columns);
  return columns;
}

MatrixXd TrackNoise::whitened_jacobian(const VectorXd& r, const Evaluation& at, const MatrixXd& dr) const {
  MatrixXd out = MatrixXd::Zero(num_rows(), dr.cols()),
           by_shift = MatrixXd::Zero(num_rows(), 2 * num_shifts());
  // ∂o = (Σ_f h_f + C_0^{−1})^{−1} Σ_f h_f ∂r_f with h_f the second derivative of ½ρ by r_f.
  MatrixXd curvature = shift_root_.transpose() * shift_root_;
  MatrixXd shift_rhs = MatrixXd::Zero(2 * num_shifts(), dr.cols());
  for (std::size_t f = 0; f < roots_.size(); ++f) {
    const int k = 2 * shift_of_[f];
    const Vec2 e = roots_[f] * (r.segment<2>(2 * f) - at.shift.segment<2>(k));
    const double length = e.norm(), root = huber_root(length, huber_);
    // z = g(|e|) e with g² |e|² = ρ: across e the factor is g, along e it is d√ρ/d|e| = k/√ρ.
    Eigen::Matrix2d dz = root * Eigen::Matrix2d::Identity(), h = at.weights[f] * Eigen::Matrix2d::Identity();
    if (huber_ > 0 && length > huber_) {
      const Eigen::Matrix2d along = e * e.transpose() / (length * length);
      dz += (huber_ / (root * length) - root) * along;
      h -= at.weights[f] * along;  // Huber's loss is straight outward
    }
    const Eigen::Matrix2d block = dz * roots_[f], second = roots_[f].transpose() * h * roots_[f];
    out.middleRows<2>(2 * f) = block * dr.middleRows(2 * f, 2);
    by_shift.block<2, 2>(2 * f, k) = -block;
    curvature.block<2, 2>(k, k) += second;
    shift_rhs.middleRows<2>(k) += second * dr.middleRows(2 * f, 2);
  }
  by_shift.bottomRows(2 * num_shifts()) = shift_root_;
  return out + by_shift * curvature.llt().solve(shift_rhs);
}

MatrixXd TrackNoise::weighted_jacobian(const Evaluation& at, const MatrixXd& dr) const {
  MatrixXd out = MatrixXd::Zero(num_rows(), dr.cols()),
           by_shift = MatrixXd::Zero(num_rows(), 2 * num_shifts());
  for (std::size_t f = 0; f < roots_.size(); ++f) {
    const Eigen::Matrix2d block = std::sqrt(at.weights[f]) * roots_[f];
    out.middleRows<2>(2 * f) = block * dr.middleRows(2 * f, 2);
    by_shift.block<2, 2>(2 * f, 2 * shift_of_[f]) = -block;
  }
  by_shift.bottomRows(2 * num_shifts()) = shift_root_;
  return without(by_shift, std::move(out));
}

VectorXd TrackNoise::weighted_residual(const VectorXd& r, const Evaluation& at) const {
  return weighted_jacobian(at, r);
}

MatrixXd TrackNoise::innovations(const VectorXd& r, const Evaluation& at) const {
  // A Kalman filter for the shift, which is constant between renewals: predict, compare, update.
  MatrixXd out(num_observations(), 2);
  Vec2 mean = Vec2::Zero();
  Eigen::Matrix2d spread = shift_covariances_[0];
  for (std::size_t f = 0; f < roots_.size(); ++f) {
    for (int k = f > 0 ? shift_of_[f - 1] : 0; k < shift_of_[f]; ++k) spread += shift_covariances_[k + 1];
    const Eigen::Matrix2d inverse = roots_[f].inverse();
    const Eigen::Matrix2d noise = inverse * inverse.transpose() / at.weights[f];
    const Eigen::Matrix2d total = spread + noise;
    const Vec2 surprise = r.segment<2>(2 * f) - mean;
    out.row(f) = total.llt().matrixL().solve(surprise).transpose();
    const Eigen::Matrix2d gain = spread * total.inverse();
    mean += gain * surprise;
    spread -= gain * spread;
    spread = 0.5 * (spread + spread.transpose()).eval();
  }
  return out;
}

Eigen::Matrix2d with_floor(const Eigen::Matrix2d& covariance, double min_sigma) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(covariance);
  const Vec2 raised = eigen.eigenvalues().cwiseMax(min_sigma * min_sigma);
  return eigen.eigenvectors() * raised.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace rhytid::fitting
