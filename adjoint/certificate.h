// The gradient certificate: evidence, on the user's own scene, that the derivatives are those of the
// simulation.
//
//   duality        <J v, w> = <v, Jᵀ w>: tangent and adjoint are transposes of each other
//   Taylor         |Q(p + h v) − Q(p) − h Q'v| ~ h²: and they are derivatives of the program (taylor.h)
//   gauge          Σ p ∂Q/∂p = 0 over all stiffnesses, Q of displacements: exact, free of differences
//   error bar      Σ adjᵀ R predicts how far a loosely converged run is off
//   pivots         smallest pivot of the Hessian, step by step: dips where a bifurcation is near
//   repeatability  the same bits twice, and with one and two threads
//
// Source   adjoint/README.md, The certificate
// Tests    tests/adjoint/certificate_test.cpp
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "adjoint/sweeps.h"
#include "adjoint/taylor.h"

namespace rhytid::adjoint {

/// Parameters tested on their own, along a random direction and along the gradient.
struct ParameterGroup {
  std::string name;
  std::vector<std::string> addresses;
};

struct CertificateOptions {
  std::vector<std::string> addresses;  ///< tested jointly; empty = all of the scene that have an effect
  std::vector<ParameterGroup> groups;  ///< tested separately, besides
  bool each_parameter = false;         ///< one group per address, besides
  unsigned seed = 1;                   ///< of directions
  int duality_directions = 4;          ///< half in parameter coordinates, half over all native parameters
  bool displacement_output = true;     ///< the output reads displacements only: the gauge identity applies
  TaylorOptions taylor;
  double loose_tolerance = 1e-3;  ///< relative tolerance of the run whose error bar is checked
  double largest_duality = 1e-11, largest_gauge = 1e-9;
  double largest_error_bar_error = 0.5;  ///< relative
  double pivot_dip = 0.1;  ///< flagged below this times the median over the steps (Hessian's smallest pivot
                           ///< over its largest)
  /// The sweeps under test.
  std::function<decltype(tangent_sweep)> tangent = tangent_sweep;
  std::function<decltype(adjoint_sweep)> adjoint = adjoint_sweep;
};

enum class Verdict {
  pass,
  warning,  ///< nothing is wrong with the gradient, but look
  fail,
};
const char* name(Verdict verdict);

/// How the figure of a check stands to its limit when the check passes.
enum class LimitKind { at_most, at_least, near };

struct CertificateCheck {
  std::string name;
  double figure = 0, threshold = 0;  ///< what was measured, and its limit
  Verdict verdict = Verdict::fail;
  std::string sentence;
  LimitKind limit = LimitKind::at_most;
};

struct RegimeCount {
  std::string term, regime;
  long points = 0;  ///< summed over steps
};

struct CertificateReport {
  std::vector<CertificateCheck> checks;
  std::vector<TaylorSeries> taylor;
  std::vector<ParameterSpec> parameters;    ///< tested jointly
  std::vector<double> gradient;             ///< dQ/dx of those, x as in parameter_space.h
  std::vector<std::string> without_effect;  ///< addresses left out: derivative zero but for rounding
  /// Addresses left out: results are not differentiable by them here (SceneModel::is_smooth_in).
  std::vector<std::string> not_smooth;
  std::vector<RegimeCount> regimes;  ///< how much contact, stick and slip the run saw
  std::vector<double> step_times;    ///< s, end of each step
  SweepReport steps;                 ///< pivots and residuals per step
  double noise = 0;                  ///< of the functional
  double error_bar = 0;              ///< Σ adjᵀ R of the run itself
  double forward_seconds = 0, tangent_seconds = 0, adjoint_seconds = 0, total_seconds = 0;
  bool interrupted = false;
  /// No check failed and all were done.
  bool passed() const;
};

/// Told before each part and within; return false to stop (the report then says interrupted).
using CertificateProgress = std::function<bool(const std::string& part, int done, int total)>;

/// How a run must be converged for the certificate: tight, with the polish.
MinimiserOptions certificate_minimiser(const MinimiserOptions& from);

/// Checks the gradient of Σ_f weights_f · output_f at the scene's parameters. `run` is a complete run of
/// scene_model.native() with states, converged with certificate_minimiser(). Throws InputError for an unknown
/// address, GradientError when the run cannot be differentiated.
CertificateReport certify(const SceneModel& scene_model, const Trajectory& run, const Output& output,
                          const std::vector<VectorXd>& weights, const CertificateOptions& options = {},
                          const CertificateProgress& progress = {});

/// The default functional of a scene: positions of at most `points` outer points spread over the faces and
/// their mean displacement along the normal, in every frame.
std::shared_ptr<const Output> default_output(const Model& model, int points = 200);
/// Seeded normal weights for every value of an output, divided by the number of values.
std::vector<VectorXd> random_weights(const Output& output, int frames, unsigned seed);

}  // namespace rhytid::adjoint
