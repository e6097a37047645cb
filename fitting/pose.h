// Where a camera stands to points that it sees: least squares over its pose, for landmarks (landmarks.h) and
// for points that stand still on a head that moves (head_motion.h).
//
// The pose R, t (X_c = R X + t) minimises χ² = Σ rᵀ W r, r = observed − project(X). Steps and covariances are
// about the points' centroid m in the camera's frame, X_c = exp(ω) (R X + t − m) + m + τ.
//
// Units  px, mm, rad.   Tests  tests/fitting/landmarks_test.cpp, head_motion_test.cpp
#pragma once

#include <vector>

#include "fitting/cameras.h"

namespace rhytid::fitting {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A point of the world seen in the picture.
struct SightedPoint {
  Vec2 pixel = Vec2::Zero();                                  ///< px
  Vec3 point = Vec3::Zero();                                  ///< mm
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();  ///< W, inverse covariance, 1/px²
};

/// χ² at a pose with its normal equations by (ω, τ).
struct PoseNormal {
  double chi_square = 0;  ///< infinite when a point is behind the camera
  Matrix6d hessian = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();  ///< Σ Jᵀ W r
};

/// Mean of the points, mm, world. At least one.
Vec3 centroid(const std::vector<SightedPoint>& points);

/// ∂(px of the point)/∂(ω, τ) about `middle`, a world point.
Eigen::Matrix<double, 2, 6> pose_jacobian(const Camera& camera, const Vec3& point, const Vec3& middle);

PoseNormal pose_normal(const std::vector<SightedPoint>& points, const Camera& camera);

/// The camera after a step (ω, τ) about `middle`, a world point.
Camera moved_pose(const Camera& camera, const Vec3& middle, const Vector6d& step);

/// The camera with the pose that minimises χ² from its own as a start, to rounding (Gauss-Newton, damped).
/// A start with points behind it is returned as it is.
Camera refine_pose(const std::vector<SightedPoint>& points, const Camera& start);

}  // namespace rhytid::fitting
