// The finger of rendered footage and of finger masks: the colliding sphere is its tip, and it rises from the
// skin toward the lower edge of the picture, as a finger does that belongs to a hand. Only the tip touches.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "fitting/cameras.h"
#include "sim/scene/scene.h"

namespace rhytid::tools {

/// A capsule: all points within `radius` of the segment tip–end, mm.
struct Finger {
  Vec3 tip, end;
  double radius;
  Mat3 rotation = Mat3::Identity();  ///< of the collider, from its axes to the world's

  /// Smallest s > 0 with origin + s · direction on the capsule, or nothing. Direction of any length.
  std::optional<double> hit(const Vec3& origin, const Vec3& direction) const;
  /// Point of the axis nearest to x.
  Vec3 axis_point(const Vec3& x) const;
};

/// Direction from tip to end: 62° above the skin, toward the lower edge of the picture.
Vec3 finger_direction(const Vec3& mean_normal, const fitting::Camera& camera);

/// The sphere colliders of a scene at a time (s), along their paths, in the order of the scene. Other shapes have no
/// finger. `direction` is that at time 0: a finger turns as its collider does.
std::vector<Finger> fingers_at(const Scene& scene, double time, const Vec3& direction);

/// Middles of `count` drawn dots on a finger as the camera sees it at the start: one in the middle, the others about
/// it; in the collider's axes from its centre, mm. `finger` is that of time 0.
std::vector<Vec3> finger_dots(const Finger& finger, const fitting::Camera& camera, int count);
/// Radius of a dot, mm.
double dot_radius(const Finger& finger);

/// Outline of a finger in the picture, grown by `margin_px`: a convex polygon, px; empty when it is not
/// wholly in front of the camera.
std::vector<cv::Point2f> finger_outline(const Finger& finger, const fitting::Camera& camera,
                                        double margin_px);

}  // namespace rhytid::tools
