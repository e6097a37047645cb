#include "tools/render/finger.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "sim/scene/collider_motion.h"

namespace rhytid::tools {
namespace {

/// Smaller root s > 0 of |o + s d| = r, for o and d without their parts along the axis if it is a cylinder.
std::optional<double> quadratic_hit(const Vec3& o, const Vec3& d, double r) {
  const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - r * r;
  const double discriminant = b * b - a * c;
  if (a == 0 || discriminant < 0) return std::nullopt;
  const double s = (-b - std::sqrt(discriminant)) / a;
  return s > 0 ? std::optional<double>(s) : std::nullopt;
}

}  // namespace

Vec3 Finger::axis_point(const Vec3& x) const {
  const Vec3 axis = end - tip;
  const double length = axis.squaredNorm();
  return length > 0 ? Vec3(tip + std::clamp((x - tip).dot(axis) / length, 0.0, 1.0) * axis) : tip;
}

std::optional<double> Finger::hit(const Vec3& origin, const Vec3& direction) const {
  std::optional<double> nearest;
  const auto take = [&nearest](std::optional<double> s) {
    if (s && (!nearest || *s < *nearest)) nearest = s;
  };
  take(quadratic_hit(origin - tip, direction, radius));
  const double length = (end - tip).norm();
  if (length == 0) return nearest;
  take(quadratic_hit(origin - end, direction, radius));
  const Vec3 axis = (end - tip) / length, o = origin - tip;
  const auto side = quadratic_hit(o - o.dot(axis) * axis, direction - direction.dot(axis) * axis, radius);
  if (side) {
    const double along = (o + *side * direction).dot(axis);
    if (along >= 0 && along <= length) take(side);
  }
  return nearest;
}

Vec3 finger_direction(const Vec3& mean_normal, const fitting::Camera& camera) {
  const Vec3 down = camera.rotation.row(1).transpose();
  Vec3 along = down - down.dot(mean_normal) * mean_normal;
  if (along.norm() < 1e-6) along = mean_normal.unitOrthogonal();
  const double elevation = 62 * std::numbers::pi / 180;
  return std::cos(elevation) * along.normalized() + std::sin(elevation) * mean_normal;
}

std::vector<Finger> fingers_at(const Scene& scene, double time, const Vec3& direction) {
  std::vector<Finger> fingers;
  for (const ColliderScene& collider : scene.colliders) {
    if (collider.shape != ShapeKind::sphere) continue;
    const ColliderMotion motion(collider, scene.time.offset);
    const BodyPose now = motion.at(time);
    const Vec3 turned = now.rotation * motion.at(0).rotation.transpose() * direction;
    fingers.push_back(
        {now.centre, now.centre + 1.2 * collider.radius * turned, collider.radius, now.rotation});
  }
  return fingers;
}

std::vector<Vec3> finger_dots(const Finger& finger, const fitting::Camera& camera, int count) {
  const Vec3 eye = camera.centre(), middle = 0.5 * (finger.tip + finger.end),
             sight = (middle - eye).normalized(), side = sight.unitOrthogonal(), third = sight.cross(side);
  std::vector<Vec3> dots;
  for (int k = 0; k < count; ++k) {
    const double angle = 2 * std::numbers::pi * k / std::max(1, count - 1),
                 far = k == 0 ? 0 : 0.5 * finger.radius;
    const Vec3 toward = middle + far * (std::cos(angle) * side + std::sin(angle) * third) - eye;
    if (const auto s = finger.hit(eye, toward))
      dots.push_back(finger.rotation.transpose() * (eye + *s * toward - finger.tip));
  }
  return dots;
}

double dot_radius(const Finger& finger) {
  return 0.05 * finger.radius;
}

std::vector<cv::Point2f> finger_outline(const Finger& finger, const fitting::Camera& camera,
                                        double margin_px) {
  // The silhouette of a sphere is the circle where lines of sight touch it; the capsule's is the hull of
  // both.
  std::vector<cv::Point2f> points;
  for (const Vec3& centre : {finger.tip, finger.end}) {
    const Vec3 to_eye = camera.centre() - centre;
    const double distance = to_eye.norm(), depth = (camera.rotation * centre + camera.translation).z();
    if (depth <= finger.radius) return {};
    const double radius = finger.radius + margin_px * depth / camera.intrinsics(0, 0);
    const Vec3 axis = to_eye / distance, side = axis.unitOrthogonal(), third = axis.cross(side);
    const double sine = std::min(0.999, radius / distance), cosine = std::sqrt(1 - sine * sine);
    for (int k = 0; k < 64; ++k) {
      const double angle = 2 * std::numbers::pi * k / 64;
      const Vec3 x =
          centre + radius * (sine * axis + cosine * (std::cos(angle) * side + std::sin(angle) * third));
      const Vec2 p = camera.project(x);
      if (p.allFinite()) points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
    }
  }
  std::vector<cv::Point2f> hull;
  if (points.size() >= 3) cv::convexHull(points, hull);
  return hull;
}

}  // namespace rhytid::tools
