// One implicit step, solved once or several times over the friction that lags behind it.
//
//   pass 1      R(u₁; u_old, s_old, lag_old) = 0           lag_old: pressure and normal of the last step
//   pass j      R(u_j; u_old, s_old, L(u_{j−1})) = 0       L: pressure and normal where pass j − 1 ended
//   the step    u = u_n;  lag = L(u_n), all other history as after any step
//
// One pass is the publication's explicit lag: first order in dt, and no friction in the step that touches
// first. The passes are a fixed-point iteration for the implicit law, in which pressure and normal are those
// of the step's own end. Each pass has a symmetric Hessian; the sweeps differentiate through all of them.
//
// Tests   tests/verification/friction_test.cpp, tests/adjoint/sweeps_test.cpp
#pragma once

#include <optional>

#include "sim/solve/minimise.h"
#include "sim/time/model.h"

namespace rhytid {

/// Solves steps one after the other, reusing matrix and factor. Model and native must outlive it. Passes before a step's
/// last are not certified as minima: what they are for is where contact presses.
class StepSolver {
 public:
  /// `passes` ≥ 1 solves per step; 1 is enough, and used, for a model without lagged friction.
  StepSolver(const Model& model, const VectorXd& native, const MinimiserOptions& options, int passes);

  /// Solves the step from displacement `start` [num_nodes·3], or, when it is null, from
  /// StepProblem::first_guess and once more from the old displacement if that does not converge; each later
  /// pass from where the one before ended. `old` must live as long as problem() is used. The report is that
  /// of the last pass, with the counts of all; when a pass fails it is that pass's. Evaluations and
  /// factorisations are all that the step took, those of the guess and of a start that was given up too.
  [[nodiscard]] MinimiserReport solve(const StepInfo& step, const State& old, const VectorXd* start = nullptr,
                                      const IterationCallback& callback = {});
  /// The same, the first pass by solve_step_softened (simulate.h).
  [[nodiscard]] MinimiserReport solve_softened(const StepInfo& step, const State& old,
                                               const IterationCallback& callback = {});
  /// Of the last pass solved.
  StepProblem& problem() { return *problem_; }
  const VectorXd& displacement() const { return u_; }
  /// Displacements that the passes before the last ended at.
  const std::vector<VectorXd>& earlier_passes() const { return earlier_; }

 private:
  MinimiserReport solve_pass(int pass, VectorXd& q, const VectorXd& held, const IterationCallback& callback,
                             GivenFactor given);
  MinimiserReport solve_later_passes(const StepInfo& step, MinimiserReport first, VectorXd q,
                                     const VectorXd& held, const IterationCallback& callback);

  const Model* model_;
  const VectorXd* native_;
  MinimiserOptions options_, earlier_options_;  ///< of the last pass, of those before it
  int passes_;
  BlockMatrix matrix_;
  CholeskyFactor factor_;
  State lagged_;
  std::optional<StepProblem> problem_;
  VectorXd u_;
  std::vector<VectorXd> earlier_;
};

/// The problems of a solved step's passes, for derivatives and reports: one per entry of `earlier` and one
/// for the last. The model, native vector and old state must outlive it.
class StepPasses {
 public:
  StepPasses(const Model& model, const VectorXd& native, const StepInfo& step, const State& old,
             const std::vector<VectorXd>& earlier);
  int count() const { return static_cast<int>(problems_.size()); }
  StepProblem& pass(int j) { return *problems_[static_cast<std::size_t>(j)]; }
  StepProblem& last() { return *problems_.back(); }

 private:
  std::vector<std::unique_ptr<State>> states_;  // what the later passes start from
  std::vector<std::unique_ptr<StepProblem>> problems_;
};

}  // namespace rhytid
