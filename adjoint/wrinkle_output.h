// Wrinkles as numbers that can be differentiated: the descriptors of sim/output/wrinkles.h on a line or a
// window of the outer skin, frame by frame.
//
//   h = N u (displacement along the rest normals, linear),   b = B h (band-passed, linear)
//   amplitude    A = (4/3 · ∫b⁴/∫b²)^½                      wavelength   λ = 2π (∫b²/tr M)^½,  M = ∫∇b ∇bᵀ
//   orientation  c = (M₁₁ − M₂₂)/tr M,  s = 2 M₁₂/tr M      = coherence · (cos 2φ, sin 2φ)
//
// φ is the direction of the wave vector and the main axis of the structure tensor M. The angle itself jumps
// by π and has no derivative where waves run in all directions; the doubled angle, weighted with the
// coherence, is smooth, and it is 0 there. Amplitude and wavelength are those of `describe`, to the bit; on a
// train of plane waves that fills the window they are exact but for the sampling (10 points a wave: 1 %).
//
// Smooth   wherever there are wrinkles. Flat skin (least_wrinkle_height) has values and derivatives zero: A
//          has a cusp there, as every amplitude has. Units   mm; c, s plain numbers.
// Tests    tests/adjoint/outputs_test.cpp
#pragma once

#include "adjoint/outputs.h"
#include "sim/output/surface_samples.h"
#include "sim/output/wrinkles.h"

namespace rhytid::adjoint {

/// [amplitude, wavelength] on a line, [amplitude, wavelength, c, s] on a window, at every frame from
/// `first_frame` on.
class WrinkleDescription final : public Output {
 public:
  /// Throws ContractError for a band that is none, or for a line with a point beside the skin.
  WrinkleDescription(SurfaceSamples samples, const WrinkleBand& band, int first_frame = 1);
  int size(int frame) const override { return frame < first_frame_ ? 0 : num_values(); }
  VectorXd values(int frame, const State& state) const override;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const override;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const override;

 private:
  int num_values() const { return samples_.columns() == 1 ? 2 : 4; }
  /// Band-passed heights [rows][columns]; NaN beside the skin.
  MatrixXd waves(const VectorXd& u) const;
  /// Adds the gradient of Σ weights · values.
  void add_gradient(const VectorXd& u, const VectorXd& weights, VectorXd& u_bar) const;

  SurfaceSamples samples_;
  WrinkleBand band_;
  int first_frame_;
};

}  // namespace rhytid::adjoint
