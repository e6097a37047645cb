#include "fitting/marker_search.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace rhytid::fitting {
namespace {

constexpr int kRounds = 50;           // of Gauss-Newton over all frames; five do unless weights change
constexpr double kSettled = 1e-6;     // px, largest change that ends it
constexpr double kLeastRcond = 1e-8;  // of a pose's normal matrix with a unit diagonal

double huber_weight(double size, double huber) {
  return huber > 0 && size > huber ? huber / size : 1;
}

double huber_cost(double size, double huber) {
  return huber > 0 && size > huber ? 2 * huber * size - huber * huber : size * size;
}

}  // namespace

Camera seen_from_body(const Camera& camera, const BodyPose& body) {
  Camera relative = camera;
  relative.rotation = camera.rotation * body.rotation;
  relative.translation = camera.rotation * body.centre + camera.translation;
  return relative;
}

BodyPose body_of(const Camera& camera, const Camera& relative) {
  BodyPose body;
  // A product of rotations drifts off by rounding only; a path wants a unit quaternion.
  body.rotation = Eigen::Quaterniond(Mat3(camera.rotation.transpose() * relative.rotation))
                      .normalized()
                      .toRotationMatrix();
  body.centre = camera.rotation.transpose() * (relative.translation - camera.translation);
  return body;
}

MarkerSearch::MarkerSearch(const std::vector<MarkerPoint>& points, PoseBasis basis, double huber)
    : points_(points), basis_(std::move(basis)), huber_(huber) {
  for (const MarkerPoint& p : points) middle_ += p.place / static_cast<double>(points.size());
  shifts_ = VectorXd::Zero(2 * static_cast<Eigen::Index>(points.size()));
}

Vec2 MarkerSearch::residual(const FramedMarker& frame, const MarkerSight& s, const VectorXd& shifts) const {
  return s.pixel - frame.pose.project(place_of(s)) -
         s.gain * shift(shifts, static_cast<std::size_t>(s.point));
}

double MarkerSearch::weight(const Vec2& r, const MarkerSight& s) const {
  return huber_weight(std::sqrt(r.dot(s.information * r)), huber_);
}

double MarkerSearch::cost_of(const FramedMarker& frame, const VectorXd& shifts) const {
  double cost = 0;
  for (const MarkerSight& s : frame.sights) {
    const Vec2 r = residual(frame, s, shifts);
    if (!r.allFinite()) return std::numeric_limits<double>::infinity();
    cost += huber_cost(std::sqrt(r.dot(s.information * r)), huber_);
  }
  return cost;
}

double MarkerSearch::cost_of(const std::vector<FramedMarker>& frames, const VectorXd& shifts) const {
  double cost = 0;
  for (std::size_t i = 0; i < points_.size(); ++i)
    cost += shift(shifts, i).dot(points_[i].common.inverse() * shift(shifts, i));
  for (const FramedMarker& frame : frames) cost += cost_of(frame, shifts);
  return cost;
}

MarkerSearch::Normal MarkerSearch::normal_of(const FramedMarker& frame) const {
  const auto k = basis_.cols();
  Normal n{PoseMatrix::Zero(k, k), PoseVector::Zero(k), MatrixXd::Zero(k, shifts_.size())};
  for (const MarkerSight& s : frame.sights) {
    const Vec2 r = residual(frame, s, shifts_);
    const Eigen::Matrix2d w = weight(r, s) * s.information;
    const Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 6> jacobian =
        pose_jacobian(frame.pose, place_of(s), middle_) * basis_;
    n.pose += jacobian.transpose() * w * jacobian;
    n.gradient += jacobian.transpose() * (w * r);
    n.mixed.middleCols<2>(2 * s.point) += jacobian.transpose() * w * s.gain;
  }
  return n;
}

MarkerSearch::Joint MarkerSearch::joint_of(const std::vector<FramedMarker>& frames) const {
  Joint joint{{}, MatrixXd::Zero(shifts_.size(), shifts_.size()), VectorXd::Zero(shifts_.size())};
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const auto at = 2 * static_cast<Eigen::Index>(i);
    const Eigen::Matrix2d information = points_[i].common.inverse();
    joint.shifts.block<2, 2>(at, at) += information;
    joint.gradient.segment<2>(at) -= information * shift(shifts_, i);
  }
  for (const FramedMarker& frame : frames) {
    Normal n = normal_of(frame);
    for (const MarkerSight& s : frame.sights) {
      const Vec2 r = residual(frame, s, shifts_);
      const Eigen::Matrix2d w = weight(r, s) * s.information;
      joint.shifts.block<2, 2>(2 * s.point, 2 * s.point) += s.gain.transpose() * w * s.gain;
      joint.gradient.segment<2>(2 * s.point) += s.gain.transpose() * (w * r);
    }
    const auto factor = n.pose.ldlt();
    joint.shifts -= n.mixed.transpose() * factor.solve(n.mixed);
    joint.gradient -= n.mixed.transpose() * factor.solve(n.gradient);
    joint.frames.push_back(std::move(n));
  }
  return joint;
}

bool MarkerSearch::is_determined(const PoseMatrix& hessian) {
  const VectorXd scale = hessian.diagonal().cwiseSqrt();
  if (!scale.allFinite() || !(scale.minCoeff() > 0)) return false;
  const VectorXd inverse = scale.cwiseInverse();
  const MatrixXd scaled = inverse.asDiagonal() * hessian * inverse.asDiagonal();
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(scaled, Eigen::EigenvaluesOnly).eigenvalues()[0] >
         kLeastRcond;
}

bool MarkerSearch::place(FramedMarker& frame) const {
  double cost = cost_of(frame, shifts_), damping = 1e-6;
  for (int iteration = 0; iteration < 100 && std::isfinite(cost) && damping < 1e12; ++iteration) {
    const Normal n = normal_of(frame);
    PoseMatrix damped = n.pose;
    damped.diagonal() *= 1 + damping;
    const PoseVector step = damped.ldlt().solve(n.gradient);
    if (!step.allFinite()) return false;
    FramedMarker next = frame;
    next.pose = moved_pose(frame.pose, middle_, basis_ * step);
    const double there = cost_of(next, shifts_);
    if (!(there <= cost)) {
      damping *= 10;
      continue;
    }
    const bool is_done = cost - there <= 1e-13 * cost;
    frame.pose = next.pose;
    cost = there;
    damping = std::max(1e-12, damping / 10);
    if (is_done) break;
  }
  return std::isfinite(cost) && is_determined(normal_of(frame).pose);
}

void MarkerSearch::settle(std::vector<FramedMarker>& frames) {
  double cost = cost_of(frames, shifts_);
  for (int round = 0; round < kRounds; ++round) {
    const Joint joint = joint_of(frames);
    const VectorXd shift_step = joint.shifts.ldlt().solve(joint.gradient);
    std::vector<PoseVector> pose_steps;
    double largest = shift_step.lpNorm<Eigen::Infinity>();
    for (std::size_t f = 0; f < frames.size(); ++f) {
      pose_steps.push_back(
          joint.frames[f].pose.ldlt().solve(joint.frames[f].gradient - joint.frames[f].mixed * shift_step));
      for (const MarkerSight& s : frames[f].sights)
        largest = std::max(
            largest,
            (pose_jacobian(frames[f].pose, place_of(s), middle_) * basis_ * pose_steps.back()).norm());
    }
    double share = 1;
    for (; share > 1e-6; share *= 0.5) {
      std::vector<FramedMarker> next = frames;
      for (std::size_t f = 0; f < frames.size(); ++f)
        next[f].pose = moved_pose(frames[f].pose, middle_, basis_ * (share * pose_steps[f]));
      const VectorXd shifts = shifts_ + share * shift_step;
      const double there = cost_of(next, shifts);
      if (!(there <= cost * (1 + 1e-12))) continue;
      frames = std::move(next);
      shifts_ = shifts;
      cost = there;
      break;
    }
    if (share * largest < kSettled || share <= 1e-6) break;
  }
}

void MarkerSearch::set_scales(const std::vector<FramedMarker>& frames, MarkerMotion& motion) const {
  double own = 0, count = 0;
  for (const FramedMarker& frame : frames)
    for (const MarkerSight& s : frame.sights) {
      const Vec2 r = residual(frame, s, shifts_);
      const double size = std::sqrt(r.dot(s.information * r));
      own += huber_weight(size, huber_) * size * size;
      count += 2;
    }
  double alike = 0;
  for (std::size_t i = 0; i < points_.size(); ++i)
    alike += shift(shifts_, i).dot(points_[i].common.inverse() * shift(shifts_, i));
  const auto free = static_cast<double>(shifts_.size() - basis_.cols());
  const double own_free =
      count - static_cast<double>(basis_.cols()) * static_cast<double>(frames.size()) - std::max(0.0, free);
  motion.own_scale = own_free > 0 ? std::sqrt(own / own_free) : 1;
  motion.shift_scale = free > 0 ? std::sqrt(alike / free) : 0;
}

void MarkerSearch::conclude(const std::vector<FramedMarker>& frames, const Camera& camera,
                            MarkerMotion& motion) const {
  const Joint joint = joint_of(frames);
  const auto unknowns = basis_.cols(), of_shifts = shifts_.size();
  set_scales(frames, motion);
  const double widen_own = std::max(1.0, motion.own_scale * motion.own_scale),
               widen_alike = std::max(1.0, motion.shift_scale * motion.shift_scale);
  const MatrixXd of_shift = widen_alike * joint.shifts.ldlt().solve(MatrixXd::Identity(of_shifts, of_shifts));
  for (std::size_t f = 0; f < frames.size(); ++f) {
    MarkerFrame& out = motion.frames[static_cast<std::size_t>(frames[f].index)];
    out.pose = body_of(camera, frames[f].pose);
    out.rms = 0;
    for (const MarkerSight& s : frames[f].sights)
      out.rms += residual(frames[f], s, shifts_).squaredNorm() / static_cast<double>(frames[f].sights.size());
    out.rms = std::sqrt(out.rms);
    const PoseMatrix inverse = joint.frames[f].pose.ldlt().solve(PoseMatrix::Identity(unknowns, unknowns));
    const MatrixXd by_shift = inverse * joint.frames[f].mixed;
    const Matrix6d by_itself = widen_own * basis_ * inverse * basis_.transpose(),
                   with_all =
                       by_itself + basis_ * (by_shift * of_shift * by_shift.transpose()) * basis_.transpose();
    // The centre moves with a step about the middle of the points by ω × arm + τ.
    const Vec3 arm = -frames[f].pose.rotation * middle_;
    Mat3 cross;
    cross << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
    Eigen::Matrix<double, 3, 6> by_step;
    by_step << -cross, Mat3::Identity();
    by_step = camera.rotation.transpose() * by_step.eval();
    out.own = by_step * by_itself * by_step.transpose();
    out.covariance = by_step * with_all * by_step.transpose();
    const Mat3 turn = with_all.topLeftCorner<3, 3>();
    out.turn_sigma = std::sqrt(std::max(0.0, turn.selfadjointView<Eigen::Lower>().eigenvalues()[2]));
  }
  for (std::size_t i = 0; i < points_.size(); ++i) motion.shifts[points_[i].marker] = shift(shifts_, i);
}

}  // namespace rhytid::fitting
