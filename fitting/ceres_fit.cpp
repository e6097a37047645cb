#include <ceres/ceres.h>
#include <glog/logging.h>

#include <cmath>
#include <limits>

#include "fitting/optimise.h"

namespace rhytid::fitting {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The objective as one residual block.
class ExperimentCost final : public ceres::CostFunction {
 public:
  ExperimentCost(Search& search, int max_evaluations) : search_(search), max_evaluations_(max_evaluations) {
    set_num_residuals(search.num_residuals());
    mutable_parameter_block_sizes()->push_back(search.num_parameters());
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const VectorXd t = Eigen::Map<const VectorXd>(parameters[0], search_.num_parameters());
    // Runs are counted by their effect: an evaluation at the kept point costs none.
    if (search_.forward_runs() >= max_evaluations_ && !(t == last_)) return false;
    last_failed_ = true;
    const ObjectiveEvaluation& evaluation = search_.evaluate(t);
    last_ = t;
    if (evaluation.failed) return false;
    Eigen::Map<VectorXd>(residuals, search_.num_residuals()) = evaluation.residuals;
    const bool is_accepted = jacobians != nullptr && jacobians[0] != nullptr;
    // A better point is about to be accepted, and Ceres gives up when its Jacobian then cannot be had. So it
    // is formed here already (it is kept), where a failure only refuses the step.
    if (!is_accepted) {
      last_failed_ = evaluation.cost < accepted_cost_ && !search_.jacobian(t).has_value();
      return !last_failed_;
    }
    const std::optional<MatrixXd> jacobian = search_.jacobian(t);
    if (!jacobian) return false;
    last_failed_ = false;
    accepted_cost_ = evaluation.cost;
    Eigen::Map<RowMajor>(jacobians[0], search_.num_residuals(), search_.num_parameters()) = *jacobian;
    gradient_norm_ = (jacobian->transpose() * evaluation.residuals).norm();
    return true;
  }

  /// |∂F/∂t| where the Jacobian was last formed: the accepted point. (Ceres reports the length of the
  /// projected gradient step instead, which a bound cuts.)
  double gradient_norm() const { return gradient_norm_; }
  /// The last trial could not be run: steps then shrink until they pass for convergence.
  bool last_failed() const { return last_failed_; }

 private:
  Search& search_;
  int max_evaluations_;
  mutable VectorXd last_;
  mutable bool last_failed_ = false;
  mutable double gradient_norm_ = 0, accepted_cost_ = std::numeric_limits<double>::infinity();
};

/// Ceres logs a failed evaluation to stderr by itself; here it is a status.
class QuietLog {
 public:
  QuietLog() : level_(FLAGS_minloglevel) { FLAGS_minloglevel = google::GLOG_FATAL; }
  ~QuietLog() { FLAGS_minloglevel = level_; }
  QuietLog(const QuietLog&) = delete;
  QuietLog& operator=(const QuietLog&) = delete;

 private:
  int level_;
};

/// Writes the history and ends the fit when the budget is spent or the user stops it.
class Recorder final : public ceres::IterationCallback {
 public:
  Recorder(Search& search, const ExperimentCost& cost, const VectorXd& t, int max_evaluations,
           const FitIterationCallback& callback, std::vector<FitIteration>& history)
      : search_(search),
        cost_(cost),
        t_(t),
        max_evaluations_(max_evaluations),
        callback_(callback),
        history_(history) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& s) override {
    history_.push_back({.iteration = s.iteration,
                        .evaluations = search_.forward_runs(),
                        .cost = s.cost,
                        .gradient_norm = cost_.gradient_norm(),
                        .step_norm = s.step_norm,
                        .seconds = s.cumulative_time_in_seconds,
                        .values = search_.values(t_)});
    if (callback_) callback_(history_.back());
    const bool is_spent = search_.forward_runs() >= max_evaluations_;
    return is_spent || search_.was_stopped() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  Search& search_;
  const ExperimentCost& cost_;
  const VectorXd& t_;
  int max_evaluations_;
  const FitIterationCallback& callback_;
  std::vector<FitIteration>& history_;
};

}  // namespace

OptimiserOutcome fit_with_ceres(Search& search, const OptimiserOptions& options,
                                const FitIterationCallback& callback) {
  OptimiserOutcome outcome;
  VectorXd t = search.initial();
  const int last_run = search.forward_runs() + options.max_evaluations;

  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ExperimentCost cost(search, last_run);
  ceres::Problem ceres_problem(ownership);
  ceres_problem.AddResidualBlock(&cost, nullptr, t.data());
  for (int k = 0; k < search.num_parameters(); ++k) {
    ceres_problem.SetParameterLowerBound(t.data(), k, search.lower()[k]);
    ceres_problem.SetParameterUpperBound(t.data(), k, search.upper()[k]);
  }

  ceres::Solver::Options solver;
  solver.minimizer_type = ceres::TRUST_REGION;
  solver.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.initial_trust_region_radius = 1e2;  // the first steps of a far start would leave the feasible region
  solver.max_num_iterations = options.max_evaluations;
  solver.max_num_consecutive_invalid_steps = 8;
  solver.function_tolerance = options.relative_decrease;
  solver.parameter_tolerance = options.step_tolerance;
  solver.gradient_tolerance = 1e-9;
  solver.line_search_interpolation_type = ceres::QUADRATIC;  // values only: trial points need no Jacobian
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  solver.update_state_every_iteration = true;
  Recorder recorder(search, cost, t, last_run, callback, outcome.history);
  solver.callbacks.push_back(&recorder);
  ceres::Solver::Summary summary;
  const QuietLog quiet;
  ceres::Solve(solver, &ceres_problem, &summary);

  outcome.detail = summary.message;
  const bool found = search.best().size() > 0;
  outcome.t = search.all(found ? search.best() : search.initial());
  outcome.cost = found ? search.best_cost() : std::numeric_limits<double>::infinity();
  using Status = OptimiserOutcome::Status;
  if (search.was_stopped())
    outcome.status = Status::stopped;
  else if (search.best().size() == 0) {
    outcome.status = Status::failed;
    outcome.detail = "no run could be used: " + search.last_failure();
  } else if (summary.termination_type == ceres::CONVERGENCE && !cost.last_failed())
    outcome.status = Status::converged;
  else if (search.forward_runs() >= last_run || summary.termination_type == ceres::NO_CONVERGENCE)
    outcome.status = Status::max_evaluations;
  else if (cost.last_failed())
    outcome.detail = "no step from the best point could be run: " + search.last_failure();
  return outcome;
}

}  // namespace rhytid::fitting
