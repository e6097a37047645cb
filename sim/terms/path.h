// Interpolation of a collider's motion between knots, as weights: the value at a time is Σ weight · knot.
//
//   linear          between neighbours                                                    C⁰
//   spline          cubic through all knots, no curvature at the ends                     C²
//   clamped_spline  the same, at rest at both ends                                        C², C¹ at the ends
//   slerp           (orientations) sin((1 − s) Ω)/sin Ω, sin(s Ω)/sin Ω; Ω the angle between the quaternions
//
// Constant before the first knot and after the last. The rate (derivative by time) jumps at the knots of linear
// and slerp, and at both ends of a spline that is not clamped. Linear in the knots, so that tangent and adjoint take
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
  /// Which rate at a knot, where a path may have a kink: that of the piece before, after, or their mean.
  enum class Side { before, after, mean };

  /// Times in s, strictly increasing, at least one. Throws ContractError otherwise, or for a spline through
  /// more than max_spline_knots.
  explicit KnotPath(std::vector<double> times, PathKind kind = PathKind::linear);
  /// Spherical interpolation: `angles` [knots − 1] between neighbouring unit quaternions, in [0, π/2).
  KnotPath(std::vector<double> times, std::vector<double> angles);

  const std::vector<double>& times() const { return times_; }
  /// Weights of the knots at time t; they sum to 1 but for slerp.
  std::vector<KnotWeight> weights(double t) const;
  /// Their derivatives by time, 1/s. Times within same_time of a knot are taken to be at it.
  std::vector<KnotWeight> rates(double t, Side side = Side::mean) const;
  static constexpr double same_time = 1e-9;  ///< s; frame times and files carry rounding

  /// A spline's value depends on every knot: its weights are kept as a matrix.
  static constexpr int max_spline_knots = 2000;

 private:
  /// Adds `factor` times the rates of the piece from knot `lo` at t; none before the first and after the last.
  void add_rates(int lo, double t, double factor, std::vector<KnotWeight>& result) const;

  std::vector<double> times_, angles_;
  MatrixXd
      curvature_;  ///< [knots][knots] second derivative at the knots from the knots; empty unless a spline
};

}  // namespace rhytid
