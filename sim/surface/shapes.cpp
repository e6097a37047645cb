#include "sim/surface/shapes.h"

#include <cmath>

#include "sim/core/error.h"

namespace rhytid {

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

}  // namespace rhytid
