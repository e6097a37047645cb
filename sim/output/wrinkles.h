// What a wrinkled surface shows: numbers from heights h, the displacement along the rest normals, sampled at
// equal spacing along a line or on a rectangular grid.
//
// Heights are band-passed first, so that the dent of a finger and the curvature of a face are not counted:
//   b = (S_short − S_long) h,   S_L: local linear fit with Gaussian weights of standard deviation σ,
//                               half of a wave of length L passes:  exp(−½ (2π σ/L)²) = ½
// which is linear in h and hence in the displacements, and gives exactly zero for a plane.
//
// Descriptors come from a few integrals of b, exact for a train of plane waves A sin(k·x):
//   amplitude    A = (4/3 · ∫b⁴/∫b²)^½
//   wavelength   λ = 2π (∫b²/∫|∇b|²)^½
//   extent       length or area of the train:  3/2 · (∫b²)²/∫b⁴
//   direction    of k: main axis of ∫∇b ∇bᵀ;  coherence: (t₁ − t₂)/(t₁ + t₂) of its eigenvalues
// They are smooth functions of the displacements wherever there are wrinkles (counts are not).
//
// Units   mm, rad.   Tests   tests/sim/output/test_wrinkles.cpp
#pragma once

#include <limits>

#include "sim/core/types.h"

namespace rhytid {

/// Waves lower than this are none, mm: a nanometre, far below what skin can show and far above what rounding
/// leaves on a flat surface (1e-14 mm). A fraction of the largest height would not do: it may be rounding
/// too.
inline constexpr double least_wrinkle_height = 1e-6;
/// Nor are those less steep than this: a nanometre over a metre. A flat surface that is lifted has only
/// rounding for slopes, but any height.
inline constexpr double least_wrinkle_slope = 1e-9;

/// Wavelengths that count as wrinkles, mm. Outside they fade away.
struct WrinkleBand {
  double shortest = 0;                                       ///< 0 = no smoothing
  double longest = std::numeric_limits<double>::infinity();  ///< inf = nothing is taken away
  void validate() const;                                     ///< throws ContractError
};

/// Standard deviation of the Gaussian that halves waves of this length, mm.
double half_pass_deviation(double wavelength);

/// Band-passed heights along a line, [n]. Linear in the heights. Here and below a line has no gaps: throws
/// ContractError unless all heights are finite.
VectorXd band_pass(const VectorXd& heights, double spacing, const WrinkleBand& band);

/// The same on a grid [nx][ny]; NaN marks points that are not on the surface, there and nowhere else the
/// result is NaN too.
MatrixXd band_pass(const MatrixXd& heights, double spacing, const WrinkleBand& band);

/// The integrals that descriptors are made of.
struct WrinkleSums {
  double square = 0, fourth = 0;                       ///< ∫b², ∫b⁴
  Eigen::Matrix2d gradient = Eigen::Matrix2d::Zero();  ///< ∫∇b ∇bᵀ; along a line only (0, 0)
};
WrinkleSums wrinkle_sums(const VectorXd& band_passed, double spacing);
/// Points whose derivatives need one that is not on the surface do not count. One column is a line.
WrinkleSums wrinkle_sums(const MatrixXd& band_passed, double spacing);

/// Derivative of Σ bar · sums by the band-passed heights, [nx][ny] (one column: a line); NaN beside the
/// surface.
MatrixXd wrinkle_sums_transpose(const MatrixXd& band_passed, double spacing, const WrinkleSums& bar);
/// The transpose of band_pass: from weights of the band-passed heights, NaN beside the surface as there, to
/// weights of the heights.
MatrixXd band_pass_transpose(const MatrixXd& weights, double spacing, const WrinkleBand& band);

struct WrinkleDescriptors {
  double amplitude = 0;   ///< mm
  double wavelength = 0;  ///< mm
  double extent = 0;      ///< mm along a line, mm² on a grid
  /// Of the wave vector against the first axis, rad in (−π/2, π/2]; crests run across it.
  double direction = 0;
  double coherence = 0;  ///< 0: waves in all directions, 1: in one
};
/// All zero for a surface without wrinkles, that is with an amplitude A below least_wrinkle_height
/// or a slope 2π A/λ below least_wrinkle_slope.
WrinkleDescriptors describe(const WrinkleSums& sums);

/// Counts along a line. They jump where descriptors do not. None when `largest` is below
/// least_wrinkle_height.
struct WrinkleCount {
  /// Maxima that rise from both sides by at least `prominence` × (largest − smallest height).
  int crests = 0;
  /// Of heights beyond 2 % of the largest |height|: one for every half wave but the first.
  int sign_changes = 0;
  double crest_spacing = 0;  ///< mean distance between neighbouring crests, mm; 0 with fewer than two
  double largest = 0;        ///< half of largest − smallest height, mm
};
WrinkleCount count_wrinkles(const VectorXd& heights, double spacing, double prominence = 0.08);

}  // namespace rhytid
