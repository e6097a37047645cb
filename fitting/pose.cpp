#include "fitting/pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace rhytid::fitting {
namespace {

Mat3 rotation_of(const Vec3& w) {
  const double angle = w.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, w / angle).toRotationMatrix() : Mat3::Identity();
}

}  // namespace

Camera moved_pose(const Camera& camera, const Vec3& middle, const Vector6d& step) {
  Camera next = camera;
  const Mat3 turn = rotation_of(step.head<3>());
  const Vec3 m = camera.rotation * middle + camera.translation;
  next.rotation = turn * camera.rotation;
  next.translation = turn * (camera.translation - m) + m + step.tail<3>();
  return next;
}

Vec3 centroid(const std::vector<SightedPoint>& points) {
  Vec3 sum = Vec3::Zero();
  for (const SightedPoint& p : points) sum += p.point;
  return sum / static_cast<double>(points.size());
}

Eigen::Matrix<double, 2, 6> pose_jacobian(const Camera& camera, const Vec3& point, const Vec3& middle) {
  // By the point in the camera's frame; that of exp(ω) arm at ω = 0 is −[arm]×.
  const Vec3 arm = camera.rotation * (point - middle);
  const Eigen::Matrix<double, 2, 3> by_point =
      camera.projection_jacobian(point) * camera.rotation.transpose();
  Mat3 cross;
  cross << 0, -arm.z(), arm.y(), arm.z(), 0, -arm.x(), -arm.y(), arm.x(), 0;
  Eigen::Matrix<double, 2, 6> jacobian;
  jacobian << -by_point * cross, by_point;
  return jacobian;
}

PoseNormal pose_normal(const std::vector<SightedPoint>& points, const Camera& camera) {
  PoseNormal normal;
  const Vec3 middle = centroid(points);
  for (const SightedPoint& p : points) {
    const Vec2 r = p.pixel - camera.project(p.point);
    if (!r.allFinite()) {
      normal.chi_square = std::numeric_limits<double>::infinity();
      return normal;
    }
    const Eigen::Matrix<double, 2, 6> jacobian = pose_jacobian(camera, p.point, middle);
    normal.chi_square += r.dot(p.information * r);
    normal.hessian += jacobian.transpose() * p.information * jacobian;
    normal.gradient += jacobian.transpose() * (p.information * r);
  }
  return normal;
}

Camera refine_pose(const std::vector<SightedPoint>& points, const Camera& start) {
  Camera camera = start;
  const Vec3 middle = centroid(points);
  PoseNormal here = pose_normal(points, camera);
  double damping = 1e-6;
  for (int iteration = 0; iteration < 100 && std::isfinite(here.chi_square) && damping < 1e12; ++iteration) {
    Matrix6d damped = here.hessian;
    damped.diagonal() *= 1 + damping;
    const Camera next = moved_pose(camera, middle, damped.ldlt().solve(here.gradient));
    const PoseNormal there = pose_normal(points, next);
    if (!(there.chi_square <= here.chi_square)) {
      damping *= 10;
      continue;
    }
    const bool is_done = here.chi_square - there.chi_square <= 1e-14 * here.chi_square;
    camera = next;
    here = there;
    damping = std::max(1e-12, damping / 10);
    if (is_done) break;
  }
  return camera;
}

}  // namespace rhytid::fitting
