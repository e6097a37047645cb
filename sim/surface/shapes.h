// Rigid bodies with a closed-form signed distance: sphere and plane.
//
// Sphere  g = ±(|x| − R), ∇g = ±n, ∇²g = ±(I − n nᵀ)/|x|, n = x/|x|.
// Plane   g = n·x, ∇g = n, ∇²g = 0.
//
// Source  paper.tex "Contact" (finger as an implicit sphere). Skin under a finger and skin over a round skull
//         both lie outside the ball, so they share Side::outside.
// Smooth  analytic; the sphere except at its centre, where direction and curvature do not exist: both are
//         returned as zero there (the mean over all directions), so that nothing becomes NaN.
// Tests   tests/sim/surface/shapes_test.cpp
#pragma once

#include "sim/surface/implicit_shape.h"

namespace rhytid {

/// On which side of the surface the skin lives; the rigid body fills the other side.
enum class Side { outside, inside };

/// Ball of radius R (mm) around the origin of its frame; with Side::inside a spherical cavity in a rigid
/// body.
class Sphere final : public ImplicitShape {
 public:
  /// Throws ContractError unless radius is finite and > 0.
  explicit Sphere(double radius, Side skin_side = Side::outside);
  GapJet evaluate(const Vec3& x) const override;
  /// −1 outside, +1 for a cavity.
  double gap_by_radius() const override { return -sign_; }
  double radius() const { return radius_; }

 private:
  double radius_;
  double sign_;  // +1: the body is the ball, −1: the body is everything but the ball
};

/// Half space below the plane through the origin of its frame; the skin is on the side the normal points to.
class Plane final : public ImplicitShape {
 public:
  /// `normal` of any length; throws ContractError when it is zero or not finite.
  explicit Plane(const Vec3& normal);
  GapJet evaluate(const Vec3& x) const override;
  const Vec3& normal() const { return normal_; }

 private:
  Vec3 normal_;
};

}  // namespace rhytid
