// Force of the skin on a rigid body, frame by frame: what a force sensor under a finger would read.
//
//   F = Σ_nodes Σ_terms ∂W_term/∂u = ∫ (t_contact + t_friction) dA,   on the body; on the skin it is −F
//
// W_term are the incremental potentials of the last (pass of the) step that led to the frame: contact depends
// on u and on where the body is, friction on the old state, the lag and the slip too, and both on κ, μ and
// the path themselves. All derivatives come from the blocks of the terms: with e_a one component of every
// node,
//   ∂F_a/∂u = K_term e_a,   other derivatives those of e_aᵀ R_term.
//
// Units   N; world axes.   Tests   tests/adjoint/outputs_test.cpp
#pragma once

#include <string>
#include <vector>

#include "adjoint/outputs.h"

namespace rhytid::adjoint {

/// Resultant [3] of some terms at every frame from `first_frame` on.
class ResultantForce final : public StepOutput {
 public:
  /// Throws ContractError for a term that the model does not have.
  ResultantForce(const Model& model, const std::vector<std::string>& terms, int first_frame = 1);
  int size(int frame) const override { return frame >= first_frame_ ? 3 : 0; }
  VectorXd step_values(int frame, const StepProblem& step, const State& state) const override;
  MatrixXd step_tangent(int frame, const StepProblem& step, const State& state,
                        const StepDirections& directions) const override;
  void step_adjoint(int frame, const StepProblem& step, const State& state, const VectorXd& weights,
                    StepBars& bars) const override;

 private:
  std::vector<std::size_t> terms_;
  int first_frame_;
};

/// Force on a collider: its contact and, when it has any, its friction. Throws ContractError for a name that
/// no collider of the model has.
ResultantForce collider_force(const Model& model, const std::string& name, int first_frame = 1);

}  // namespace rhytid::adjoint
