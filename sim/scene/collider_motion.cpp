#include "sim/scene/collider_motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sim/surface/shapes.h"

namespace rhytid {
namespace {

Eigen::Vector4d quaternion_of(const Vec3& rotation) {
  const double half = 0.5 * rotation.norm();
  Eigen::Vector4d q;
  q << std::cos(half), (half > 0 ? std::sin(half) / half : 1.0) * 0.5 * rotation;
  return q.normalized();
}

}  // namespace

std::shared_ptr<const ImplicitShape> collider_shape(const ColliderScene& c) {
  switch (c.shape) {
    case ShapeKind::plane:
      return std::make_shared<Plane>(c.normal);
    case ShapeKind::capsule:
      return std::make_shared<Capsule>(c.radius, 0.5 * c.length, c.axis);
    case ShapeKind::ellipsoid:
      return std::make_shared<Ellipsoid>(c.semi_axes);
    case ShapeKind::sphere:
    case ShapeKind::imls:  // never of a collider
      break;
  }
  return std::make_shared<Sphere>(c.radius);
}

double collider_radius(const ColliderScene& c) {
  return c.shape == ShapeKind::sphere || c.shape == ShapeKind::capsule ? c.radius : 0;
}

double angle_between(const PathKnot& a, const PathKnot& b) {
  const double cosine = std::fabs(quaternion_of(a.rotation).dot(quaternion_of(b.rotation)));
  return 2 * std::acos(std::min(1.0, cosine));
}

bool has_motion(const Scene& scene) {
  const auto moves = [](const auto& body) { return body.path.size() > 1; };
  return std::any_of(scene.colliders.begin(), scene.colliders.end(), moves) ||
         std::any_of(scene.skin.held.begin(), scene.skin.held.end(), moves);
}

ColliderMotion::ColliderMotion(const ColliderScene& c, double ahead) : ahead_(ahead) {
  std::vector<double> times, angles;
  bool turns = false;
  for (const PathKnot& k : c.path) {
    times.push_back(k.time);
    centres_.push_back(k.position);
    turns = turns || !k.rotation.isZero(0);
  }
  positions_ = std::make_shared<KnotPath>(times, c.interpolation);
  if (!turns) return;
  for (const PathKnot& k : c.path) {
    Eigen::Vector4d q = quaternion_of(k.rotation);
    if (!quaternions_.empty()) {
      if (q.dot(quaternions_.back()) < 0) q = -q;
      // Twice the half chord: keeps its digits for small angles, unlike the arc cosine.
      angles.push_back(2 * std::asin(std::min(1.0, 0.5 * (q - quaternions_.back()).norm())));
    }
    quaternions_.push_back(q);
  }
  orientations_ = c.interpolation == PathKind::linear ? std::make_shared<KnotPath>(times, angles)
                                                      : std::make_shared<KnotPath>(times, c.interpolation);
}

BodyPose ColliderMotion::at(double time) const {
  BodyPose pose;
  for (const KnotWeight& w : positions_->weights(time + ahead_))
    pose.centre += w.weight * centres_[static_cast<std::size_t>(w.knot)];
  if (!orientations_) return pose;
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  for (const KnotWeight& w : orientations_->weights(time + ahead_))
    q += w.weight * quaternions_[static_cast<std::size_t>(w.knot)];
  pose.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
  return pose;
}

}  // namespace rhytid
