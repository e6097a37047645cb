// Interpolation of a collider's motion between knots, as weights: the value at a time is Σ weight · knot.
//
//   linear          between neighbours                                                    C⁰
//   spline          cubic through all knots, no curvature at the ends                     C²
//   clamped_spline  the same, at rest at both ends                                        C², C¹ at the ends
//   slerp           (orientations) sin((1 − s) Ω)/sin Ω, sin(s Ω)/sin Ω; Ω the angle between the quaternions
//
// Constant before the first knot and after the last. Linear in the knots, so that tangent and adjoint take
// the derivative by a knot from the same weights; Ω belongs to the knots the path was built with. Quaternions
// are interpolated component by component and normalised where they are used (contact_law.h).
//
// Units   s, mm.   Tests   tests/sim/terms/path_test.cpp
#pragma once

#include <vector>

#include "sim/core/types.h"

namespace rhytid {

enum class PathKind { linear, spline, clamped_spline };

struct KnotWeight {
  int knot;
  double weight;
};

class KnotPath {
 public:
  /// Times in s, strictly increasing, at least one. Throws ContractError otherwise, or for a spline through
  /// more than max_spline_knots.
  explicit KnotPath(std::vector<double> times, PathKind kind = PathKind::linear);
  /// Spherical interpolation: `angles` [knots − 1] between neighbouring unit quaternions, in [0, π/2).
  KnotPath(std::vector<double> times, std::vector<double> angles);

  const std::vector<double>& times() const { return times_; }
  /// Weights of the knots at time t; they sum to 1 but for slerp.
  std::vector<KnotWeight> weights(double t) const;

  /// A spline's value depends on every knot: its weights are kept as a matrix.
  static constexpr int max_spline_knots = 2000;

 private:
  std::vector<double> times_, angles_;
  MatrixXd
      curvature_;  ///< [knots][knots] second derivative at the knots from the knots; empty unless a spline
};

}  // namespace rhytid
