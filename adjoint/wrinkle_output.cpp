#include "adjoint/wrinkle_output.h"

#include <numbers>

#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

/// c and s.
Eigen::Vector2d orientation(const WrinkleSums& sums) {
  const Eigen::Matrix2d& m = sums.gradient;
  return Eigen::Vector2d(m(0, 0) - m(1, 1), 2 * m(0, 1)) / m.trace();
}

/// Derivative of Σ weights · values by the sums.
WrinkleSums by_sums(const WrinkleSums& sums, const WrinkleDescriptors& d, const VectorXd& weights) {
  const double trace = sums.gradient.trace();
  WrinkleSums bar;
  bar.square = weights[0] * -0.5 * d.amplitude / sums.square + weights[1] * 0.5 * d.wavelength / sums.square;
  bar.fourth = weights[0] * 0.5 * d.amplitude / sums.fourth;
  bar.gradient.diagonal().setConstant(weights[1] * -0.5 * d.wavelength / trace);
  if (weights.size() == 2) return bar;
  const Eigen::Vector2d now = orientation(sums);
  bar.gradient.diagonal().array() -= weights.tail<2>().dot(now) / trace;
  bar.gradient(0, 0) += weights[2] / trace;
  bar.gradient(1, 1) -= weights[2] / trace;
  bar.gradient(0, 1) += weights[3] / trace;  // both of the equal entries: half of ∂s/∂M₁₂ each
  bar.gradient(1, 0) += weights[3] / trace;
  return bar;
}

}  // namespace

WrinkleDescription::WrinkleDescription(SurfaceSamples samples, const WrinkleBand& band, int first_frame)
    : samples_(std::move(samples)), band_(band), first_frame_(first_frame) {
  band_.validate();
  require(samples_.columns() > 1 || samples_.missing() == 0,
          "WrinkleDescription: a point of the line lies beside the skin");
}

MatrixXd WrinkleDescription::waves(const VectorXd& u) const {
  return band_pass(samples_.heights(u), samples_.spacing(), band_);
}

VectorXd WrinkleDescription::values(int frame, const State& state) const {
  VectorXd out = VectorXd::Zero(size(frame));
  if (out.size() == 0) return out;
  const MatrixXd b = waves(state.u);
  const WrinkleSums sums = wrinkle_sums(b, samples_.spacing());
  const WrinkleDescriptors d = describe(sums);
  if (d.amplitude == 0) return out;
  out[0] = d.amplitude;
  out[1] = d.wavelength;
  if (out.size() == 4) out.tail<2>() = orientation(sums);
  return out;
}

void WrinkleDescription::add_gradient(const VectorXd& u, const VectorXd& weights, VectorXd& u_bar) const {
  const MatrixXd b = waves(u);
  const double spacing = samples_.spacing();
  const WrinkleSums sums = wrinkle_sums(b, spacing);
  const WrinkleDescriptors d = describe(sums);
  if (d.amplitude == 0) return;
  const WrinkleSums bar = by_sums(sums, d, weights);
  samples_.add_transpose(band_pass_transpose(wrinkle_sums_transpose(b, spacing, bar), spacing, band_), u_bar);
}

MatrixXd WrinkleDescription::tangent(int frame, const State& state, const MatrixXd& du,
                                     const MatrixXd&) const {
  MatrixXd out(size(frame), du.cols());
  for (Eigen::Index k = 0; k < out.rows(); ++k) {
    VectorXd gradient = VectorXd::Zero(du.rows());
    add_gradient(state.u, VectorXd::Unit(out.rows(), k), gradient);
    out.row(k) = gradient.transpose() * du;
  }
  return out;
}

void WrinkleDescription::adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
                                 VectorXd&) const {
  if (size(frame) > 0) add_gradient(state.u, weights, u_bar);
}

}  // namespace rhytid::adjoint
