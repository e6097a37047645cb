// Rigid bodies given by their exact signed distance: sphere, plane, capsule and ellipsoid.
//
// Sphere     g = ±(|x| − R), ∇g = ±n, ∇²g = ±(I − n nᵀ)/|x|, n = x/|x|.
// Plane      g = n·x, ∇g = n, ∇²g = 0.
// Capsule    g = |x − s| − R, s the point of the axis segment nearest to x; beside the segment
//            ∇²g = (I − n nᵀ − a aᵀ)/|x − s|, around its ends that of a sphere.
// Ellipsoid  g = ±|x − y|, y the point of Σ y²ᵢ/e²ᵢ = 1 nearest to x: yᵢ = e²ᵢ xᵢ/(t + e²ᵢ), t the largest
//            root of Σ (eᵢ xᵢ/(t + e²ᵢ))² = 1.  n ∝ yᵢ/e²ᵢ;  ∇²g = W (I + g W)⁻¹, W the curvature at y.
//            ∂g/∂e_k = −n_k y_k/e_k: the surface moves by n · ∂y/∂e_k along its normal.
//
// The distance, and not a cheaper implicit function with unit slope at the surface only: penetration then has
// the same meaning (mm along the normal) on every shape, so that κ and the onset do too, and R is an offset.
//
// Source  the publication, "Contact" (finger as an implicit sphere). Skin under a finger and skin over a round skull
//         both lie outside the ball, so they share Side::outside.
// Smooth  sphere, plane and ellipsoid analytic, the capsule C¹ where its ends begin (the curvature jumps);
//         all except where the nearest point is not unique, deep inside. At the centre of a sphere and on the
//         axis of a capsule direction and curvature are returned as zero (the mean over all directions); the
//         ellipsoid takes the nearest point with positive coordinates, and bounds the curvature.
// Tests   tests/sim/surface/shapes_test.cpp, ellipsoid_test.cpp
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

/// All points within R (mm) of a segment through the origin of its frame.
class Capsule final : public ImplicitShape {
 public:
  /// `half_length` mm from the origin to either end of the segment, along `axis` of any length. Throws
  /// ContractError unless radius > 0, half_length ≥ 0 and the axis is not zero.
  Capsule(double radius, double half_length, const Vec3& axis = Vec3::UnitZ());
  GapJet evaluate(const Vec3& x) const override;
  double gap_by_radius() const override { return -1; }
  double radius() const { return radius_; }
  /// Ends of the segment.
  Vec3 end(int which) const { return (which == 0 ? -half_length_ : half_length_) * axis_; }

 private:
  double radius_, half_length_;
  Vec3 axis_;
};

/// Solid ellipsoid around the origin of its frame, semi-axes along the axes of the frame.
class Ellipsoid final : public ImplicitShape {
 public:
  /// Beyond, the nearest point loses more digits than a position of skin has to spare.
  static constexpr double largest_ratio = 1000;
  /// Semi-axes in mm; throws ContractError unless they are positive and no longer than largest_ratio times
  /// the shortest.
  explicit Ellipsoid(const Vec3& semi_axes);
  GapJet evaluate(const Vec3& x) const override;
  GapJet evaluate_sized(const Vec3& x, const Vec3& semi_axes, SizeDerivatives& by_size) const override;
  const Vec3& semi_axes() const { return semi_axes_; }

 private:
  Vec3 semi_axes_;
};

}  // namespace rhytid
