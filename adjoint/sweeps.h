// Tangent and adjoint sweeps over a converged run. They only combine the blocks that the terms supply.
//
//   R_i(u_i; u_{i−1}, s_{i−1}, θ) = 0,   s_i = G(u_i; u_{i−1}, s_{i−1}, θ),   Q = Σ_f q_f(u, s at frame f)
//   tangent  K_i du_i = −(R_θ dθ + R_{u−} du_{i−1} + R_{s−} ds_{i−1})
//            ds_i = G_u du_i + G_{u−} du_{i−1} + G_{s−} ds_{i−1} + G_θ dθ
//   adjoint  K_i adj = q_u + ū_i + G_uᵀ s̄_i,       θ̄ += −R_θᵀ adj + G_θᵀ s̄_i
//            ū_{i−1} = −R_{u−}ᵀ adj + G_{u−}ᵀ s̄_i,   s̄_{i−1} = q_s − R_{s−}ᵀ adj + G_{s−}ᵀ s̄_i
//
// An output may also depend on the old state and on θ directly (StepOutput); those paths add to the bars at
// its step.
//
// K is the raw Hessian at the converged state. A run that is incomplete, kept no states, has a step that did
// not converge, lies outside the domain or whose Hessian does not factor is refused (GradientError): the
// implicit function theorem does not hold there, a number would be wrong.
//
// Source   adjoint/README.md, The algebra
// Units    θ in native units (sim/time/model.h)
// Tests    tests/adjoint
#pragma once

#include <functional>
#include <stdexcept>
#include <vector>

#include "adjoint/outputs.h"
#include "adjoint/run_states.h"
#include "sim/time/simulate.h"

namespace rhytid::adjoint {

/// The run cannot be differentiated; what() says which step and why.
class GradientError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// How near to singular each step was, and how near to a kink.
struct SweepReport {
  std::vector<double> smallest_pivot, largest_pivot;  ///< per step, of the raw Hessian's Cholesky factor
  std::vector<double> residual;                       ///< per step |R|, N
  /// Per step: points of contact and friction that are on another smooth piece of their law than at the end
  /// of the step before. Where there are many, the gradient holds in a small neighbourhood only.
  std::vector<long> regime_changes;
  double seconds = 0;

  /// Smallest pivot over the largest, per step, relative to the median over the steps; 0 where there is no
  /// median.
  std::vector<double> relative_pivots() const;
  /// Steps with a relative pivot below `dip`: a bifurcation is near, and the gradient holds in a small
  /// neighbourhood only.
  std::vector<int> near_singular_steps(double dip = 0.1) const;
};

/// Derivatives of every output along native directions. directions [native size][k]; result per frame
/// [output.size(frame)][k], frames 0..frames().
struct TangentResult {
  std::vector<MatrixXd> frames;
  SweepReport report;
};
TangentResult tangent_sweep(const Model& model, const VectorXd& native, const Trajectory& run,
                            const Output& output, const MatrixXd& directions);

/// Gradient of Σ_f weights_f · q_f by every native parameter at once.
struct AdjointResult {
  VectorXd native_bar;  ///< [native size]
  SweepReport report;
  /// adjᵀ R summed over steps: the first-order error of the functional from residuals that are not exactly
  /// zero.
  double residual_error = 0;
  CheckpointReport checkpoints;
};
AdjointResult adjoint_sweep(const Model& model, const VectorXd& native, const Trajectory& run,
                            const Output& output, const std::vector<VectorXd>& weights);

/// The same for a run that dropped its histories (RunOptions::keep_histories), holding no more than
/// `budget_bytes` of states at a time: what does not fit is recomputed, to the same bits (run_states.h).
/// adjoint_sweep has no such limit.
AdjointResult adjoint_sweep_within(std::size_t budget_bytes, const Model& model, const VectorXd& native,
                                   const Trajectory& run, const Output& output,
                                   const std::vector<VectorXd>& weights);

}  // namespace rhytid::adjoint
