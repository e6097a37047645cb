// Energy stored in the skin and what it touches at the end of a frame.
//
//   E = Σ_terms Σ_q w_q ψ_term(strain(u), s, θ)
//
// ψ as sim/time/energy_account.h counts it: skin distorted and compressed, Maxwell springs, ligaments,
// contacts; friction stores nothing. It depends on the state, and on the native parameters and the place of
// bodies directly.
//
// Units   mJ.   Tests   tests/adjoint/outputs_test.cpp
#pragma once

#include <string>
#include <vector>

#include "adjoint/outputs.h"

namespace rhytid::adjoint {

/// One value per frame from `first_frame` on.
class StoredEnergy final : public StepOutput {
 public:
  /// Of the named terms, as the model calls them ("skin", "ligaments", "contact finger"); none = of all.
  /// Throws ContractError for a name that no term has.
  explicit StoredEnergy(const Model& model, const std::vector<std::string>& terms = {}, int first_frame = 1);
  int size(int frame) const override { return frame >= first_frame_ ? 1 : 0; }
  VectorXd step_values(int frame, const StepProblem& step, const State& state) const override;
  MatrixXd step_tangent(int frame, const StepProblem& step, const State& state,
                        const StepDirections& directions) const override;
  void step_adjoint(int frame, const StepProblem& step, const State& state, const VectorXd& weights,
                    StepBars& bars) const override;

 private:
  std::vector<std::size_t> terms_;
  int first_frame_;
};

}  // namespace rhytid::adjoint
