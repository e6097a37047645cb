// A collider of a scene as a body in space: its shape, and where it is at a time.
//
// Between knots the centre is interpolated as the scene says (sim/terms/path.h). Orientations follow the same
// knots: `linear` turns at constant speed about one axis from knot to knot, the splines interpolate
// quaternions component by component (C², nearly uniform for turns below 90° between knots).
#pragma once

#include <memory>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/surface/implicit_shape.h"
#include "sim/terms/path.h"

namespace rhytid {

/// The shape in its own frame. The scene must be valid.
std::shared_ptr<const ImplicitShape> collider_shape(const ColliderScene& collider);

/// The radius that can be fitted, mm; 0 for shapes without one (plane, ellipsoid).
double collider_radius(const ColliderScene& collider);

/// Whether anything moves: a collider or a held part whose path has several knots.
bool has_motion(const Scene& scene);

/// Angle between the orientations of two knots, rad, in [0, π].
double angle_between(const PathKnot& a, const PathKnot& b);

struct BodyPose {
  Vec3 centre = Vec3::Zero();        ///< mm
  Mat3 rotation = Mat3::Identity();  ///< from the body's axes to the world's
  /// A point in the body's frame.
  Vec3 to_body(const Vec3& x) const { return rotation.transpose() * (x - centre); }
};

class ColliderMotion {
 public:
  /// The path must not be empty. Its clock runs `ahead` s (TimeScene::offset) ahead of the frames.
  ColliderMotion(const ColliderScene& collider, double ahead);

  const std::shared_ptr<const KnotPath>& positions() const { return positions_; }
  /// Null when the body never turns.
  const std::shared_ptr<const KnotPath>& orientations() const { return orientations_; }
  /// Unit quaternions (w, x, y, z) of the knots, neighbours in the same half space; empty when it never
  /// turns.
  const std::vector<Eigen::Vector4d>& quaternions() const { return quaternions_; }
  /// At a time of the frames, s.
  BodyPose at(double time) const;

 private:
  double ahead_;
  std::vector<Vec3> centres_;
  std::vector<Eigen::Vector4d> quaternions_;
  std::shared_ptr<const KnotPath> positions_, orientations_;
};

}  // namespace rhytid
