// Sub-pixel alignment of a small template in an image, with the uncertainty of the result.
//
//   minimise over p = (c, A, g, b, s)   Σ_i r_i²,   r_i = I(c + A ξ_i) − (g T_i + b + s·ξ_i)
//
// ξ_i are the integer offsets of a (2h+1)² window, T_i the template there, c the position sought, A the local
// deformation gradient since the template was taken (identity-fixed for WarpModel::translation), g and b gain
// and bias of the lighting, s its slope across the window. The slope is 0 unless it takes a third of Σ r² or more
// and stays below a tenth of b at the rim: in a window of little texture it would take what tells the position,
// and it must not explain a finger. Gauss-Newton with step halving on the cubic-spline image, all in double
// precision.
//
// Covariance: G = the two rows of (JᵀJ)⁻¹Jᵀ that belong to c, so the error of c is G times the error of r,
// and
//   Cov(c) = σ² Σ_d ρ(d) Σ_i G_i G_{i+d}ᵀ,   σ² = Σ r² / (N − parameters)
// which for white noise (ρ(0) = 1, else 0) is σ² (JᵀJ)⁻¹. ρ is the autocorrelation of the noise, from residuals pooled
// over all windows of a frame: compression and interpolation make neighbouring residuals alike, and the white
// formula is then too optimistic. Residuals are what the fit leaves of the noise: with H = J (JᵀJ)⁻¹ Jᵀ their
// covariance is (I − H) σ² R (I − H), R the matrix of ρ. Correlated noise looks like warps and light, so that the
// fit takes 5 to 20 % of it, and most of what it takes is what moves c. So σ² and ρ are those that give the
// residuals' autocovariance, by two passes of c(d) + σ² ⟨R − (I − H) R (I − H)⟩_d over up to twelve windows.
//
// Source  Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 56 (2004) 221-255 (forward additive form); the
//         covariance is linear error propagation.
// Units   px, grey values on the 0..255 scale.   Tests  tests/fitting/tracking/patch_alignment_test.cpp
#pragma once

#include <array>
#include <vector>

#include "fitting/tracking/spline_image.h"
#include "sim/core/types.h"

namespace rhytid::fitting {

enum class WarpModel { translation, affine };

/// Grey values of a square window, T_i = I(centre + ξ_i); row-major, η outer, ξ inner.
struct PatchTemplate {
  int half = 0;
  std::vector<double> values;  ///< [(2 half + 1)²]
  double mean = 0;
  double deviation = 0;  ///< standard deviation of the values; 0 = no texture
};

/// From (2 half + 1)² grey values.
PatchTemplate make_template(std::vector<double> values, int half);

/// Cuts the window of half size `half` around `centre`. Empty values when it does not fit into the image.
PatchTemplate cut_template(const SplineImage& image, const Vec2& centre, int half);

/// Where a template lies.
struct PatchWarp {
  Vec2 centre = Vec2::Zero();                              ///< c, px
  Eigen::Matrix2d gradient = Eigen::Matrix2d::Identity();  ///< A
};

enum class AlignmentStatus {
  converged,
  not_converged,  ///< iterations used up, or the step halved to nothing
  flat,           ///< too little texture: the normal matrix is singular
  outside,        ///< the window left the image
};

struct AlignmentOptions {
  WarpModel model = WarpModel::affine;
  int max_iterations = 40;
  double tolerance_px = 1e-4;  ///< stop when no point of the window moves further in a step
};

struct Alignment {
  AlignmentStatus status = AlignmentStatus::not_converged;
  PatchWarp warp;
  double residual_rms = 0;  ///< σ, grey; degrees of freedom taken off
  double correlation = 0;   ///< zero-mean normalised, of I(W) and T
  int iterations = 0;
  std::vector<float> residuals;  ///< r_i
  Eigen::Matrix2Xd influence;    ///< G, shape [2][N], px per grey value
  /// How much the free deformation costs: largest ratio of position variance to that with A held fixed, >= 1.
  double deformation_cost = 1;
  Eigen::MatrixXf jacobian;         ///< J, shape [parameters][N], grey per unit of the solver's unknowns
  Eigen::Matrix2d unit_covariance;  ///< G Gᵀ: covariance for white noise of unit variance
};

/// Aligns `patch` in `image` from the guess `start`.
Alignment align(const PatchTemplate& patch, const SplineImage& image, const PatchWarp& start,
                const AlignmentOptions& options);

/// Autocorrelation of residuals at pixel lags |dx|, |dy| <= reach, tapered to be a valid covariance.
class ResidualCorrelation {
 public:
  static constexpr int kReach = 6;

  /// Pools the residuals of all alignments given (null pointers are skipped); white when there is none.
  explicit ResidualCorrelation(const std::vector<const Alignment*>& alignments);

  /// Cov(c) of the header for noise of standard deviation `sigma` (grey). Never below a quarter of the white
  /// value: a negative estimated correlation is not trusted further.
  Eigen::Matrix2d covariance(const Alignment& alignment, double sigma) const;

  /// ρ at lag (dx, dy), 0 <= dy <= reach, |dx| <= reach.
  double at(int dx, int dy) const { return rho_[dy][dx + kReach]; }
  /// Variance of the noise over that of the residuals, σ²: 1 to 2, since correlated noise that the fitted warp
  /// and light follow is not in the residuals; where they follow more than half of it, 2.
  double variance_ratio() const { return variance_; }

 private:
  using Lags = std::array<std::array<double, 2 * kReach + 1>, kReach + 1>;  ///< [dy][dx + reach]
  void take(const Lags& covariance);
  Lags taken_by_fit(const std::vector<const Alignment*>& alignments) const;

  Lags rho_{};
  double variance_ = 1;
};

}  // namespace rhytid::fitting
