#include "sim/time/step_passes.h"

#include <algorithm>

#include "sim/core/error.h"
#include "sim/time/simulate.h"

namespace rhytid {

StepSolver::StepSolver(const Model& model, const VectorXd& native, const MinimiserOptions& options,
                       int passes)
    : model_(&model),
      native_(&native),
      options_(options),
      earlier_options_(options),
      passes_(passes),
      matrix_(model.pattern()),
      factor_(model.pattern()) {
  require(passes >= 1, "StepSolver: at least one pass");
  earlier_options_.certify_minimum = false;
  const auto lags = [](const Term& term) { return term.kernels().history_is_lag; };
  if (std::none_of(model.terms.begin(), model.terms.end(), lags)) passes_ = 1;
}

MinimiserReport StepSolver::solve_pass(int pass, VectorXd& q, const VectorXd& held,
                                       const IterationCallback& callback, GivenFactor given) {
  const MinimiserOptions& options = pass < passes_ ? earlier_options_ : options_;
  const bool moved = q != held;
  MinimiserReport report = minimise(*problem_, q, options, factor_, matrix_, callback, given);
  if (report.converged() || report.status == MinimiserStatus::interrupted || !moved) return report;
  q = held;
  const MinimiserReport given_up = std::move(report);
  report = minimise(*problem_, q, options, factor_, matrix_, callback);
  report.add_work(given_up);
  return report;
}

MinimiserReport StepSolver::solve(const StepInfo& step, const State& old, const VectorXd* start,
                                  const IterationCallback& callback) {
  problem_.emplace(*model_, *native_, step, old);
  MinimiserReport guess;
  GivenFactor given = GivenFactor::none;
  VectorXd q = start ? model_->to_unknowns(*start) : problem_->first_guess(guess);
  if (!start && !model_->constraints.moved.empty()) {
    const VectorXd response = problem_->response_to_given_motion(factor_, matrix_, guess);
    if (response.size() > 0) {
      guess.evaluations += 2;
      if (problem_->energy(response, nullptr) < problem_->energy(q, nullptr)) {
        q = response;
        given = GivenFactor::near;
      }
    }
  }
  const VectorXd held = start ? q : model_->to_unknowns(old.u);
  MinimiserReport first = solve_pass(1, q, held, callback, given);
  first.add_work(guess);
  return solve_later_passes(step, std::move(first), std::move(q), held, callback);
}

MinimiserReport StepSolver::solve_softened(const StepInfo& step, const State& old,
                                           const IterationCallback& callback) {
  problem_.emplace(*model_, *native_, step, old);
  VectorXd q;
  MinimiserReport first = solve_step_softened(*problem_, passes_ > 1 ? earlier_options_ : options_, factor_,
                                              matrix_, q, callback);
  return solve_later_passes(step, std::move(first), q, q, callback);
}

MinimiserReport StepSolver::solve_later_passes(const StepInfo& step, MinimiserReport first, VectorXd q,
                                               const VectorXd& held, const IterationCallback& callback) {
  earlier_.clear();
  MinimiserReport total = std::move(first);
  for (int pass = 1;; ++pass) {
    u_ = problem_->displacement(q);
    if (!total.converged() || pass >= passes_) return total;
    State next = problem_->relagged(u_);
    earlier_.push_back(u_);
    problem_.reset();  // it refers to lagged_
    lagged_ = std::move(next);
    problem_.emplace(*model_, *native_, step, lagged_);
    // Only what the friction is lagged from has changed; a factor of another step would make the result depend on where
    // a run began.
    const GivenFactor given = total.factorisations > 0 ? GivenFactor::near : GivenFactor::none;
    MinimiserReport report = solve_pass(pass + 1, q, held, callback, given);
    report.iterations += total.iterations;
    report.lbfgs_iterations += total.lbfgs_iterations;
    report.negative_curvature_exits += total.negative_curvature_exits;
    report.add_work(total);
    total = std::move(report);
  }
}

StepPasses::StepPasses(const Model& model, const VectorXd& native, const StepInfo& step, const State& old,
                       const std::vector<VectorXd>& earlier) {
  problems_.push_back(std::make_unique<StepProblem>(model, native, step, old));
  for (const VectorXd& u : earlier) {
    states_.push_back(std::make_unique<State>(problems_.back()->relagged(u)));
    problems_.push_back(std::make_unique<StepProblem>(model, native, step, *states_.back()));
  }
}

}  // namespace rhytid
