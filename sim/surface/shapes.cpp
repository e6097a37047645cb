#include "sim/surface/shapes.h"

#include <algorithm>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid {

GapJet ImplicitShape::evaluate_sized(const Vec3&, const Vec3&, SizeDerivatives&) const {
  throw ContractError("ImplicitShape: this shape has no sizes to change");
}

Sphere::Sphere(double radius, Side skin_side)
    : radius_(radius), sign_(skin_side == Side::outside ? 1.0 : -1.0) {
  require(std::isfinite(radius) && radius > 0, "Sphere: radius must be finite and positive");
}

GapJet Sphere::evaluate(const Vec3& x) const {
  GapJet jet;
  const double r = x.stableNorm();
  jet.gap = sign_ * (r - radius_);
  // Closer to the centre than the rounding of positions of size R, the direction is noise.
  if (r <= 1e-15 * radius_) return jet;
  const Vec3 n = x / r;
  jet.gradient = sign_ * n;
  jet.hessian = (sign_ / r) * (Mat3::Identity() - n * n.transpose());
  return jet;
}

Plane::Plane(const Vec3& normal) {
  const double length = normal.stableNorm();
  require(std::isfinite(length) && length > 0, "Plane: normal must be finite and not zero");
  normal_ = normal / length;
  normal_.normalize();
}

GapJet Plane::evaluate(const Vec3& x) const {
  GapJet jet;
  jet.gap = normal_.dot(x);
  jet.gradient = normal_;
  return jet;
}

Capsule::Capsule(double radius, double half_length, const Vec3& axis)
    : radius_(radius), half_length_(half_length) {
  require(std::isfinite(radius) && radius > 0, "Capsule: radius must be finite and positive");
  require(std::isfinite(half_length) && half_length >= 0, "Capsule: half_length must not be negative");
  const double length = axis.stableNorm();
  require(std::isfinite(length) && length > 0, "Capsule: axis must be finite and not zero");
  axis_ = (axis / length).normalized();
}

GapJet Capsule::evaluate(const Vec3& x) const {
  GapJet jet;
  const double along = axis_.dot(x), clamped = std::clamp(along, -half_length_, half_length_);
  Vec3 d = x - clamped * axis_;
  if (clamped == along) d -= axis_.dot(d) * axis_;  // exactly across, whatever the rounding
  const double r = d.stableNorm();
  jet.gap = r - radius_;
  // As for a sphere: nearer to the segment than rounding there is no direction.
  if (r <= 1e-15 * (radius_ + half_length_)) return jet;
  const Vec3 n = d / r;
  jet.gradient = n;
  jet.hessian = Mat3::Identity() - n * n.transpose();
  if (clamped == along) jet.hessian -= axis_ * axis_.transpose();
  jet.hessian /= r;
  return jet;
}

}  // namespace rhytid
