#include <chrono>
#include <cmath>
#include <limits>
#include <nlopt.hpp>

#include "fitting/optimise.h"

namespace rhytid::fitting {
namespace {

/// F over y with t = start + scale ∘ y, divided by its first value so that tolerances are relative.
struct ScaledObjective {
  Search& search;
  const FitIterationCallback& callback;
  VectorXd start, scale;
  double unit = 1;
  std::vector<FitIteration>& history;
  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
  VectorXd last_t = {};
  bool last_failed = false;  ///< the wall answered: steps then shrink until they pass for convergence

  VectorXd t_of(const std::vector<double>& y) const {
    const VectorXd moved = start + scale.cwiseProduct(Eigen::Map<const VectorXd>(y.data(), y.size()));
    return moved.cwiseMax(search.lower()).cwiseMin(search.upper());
  }

  /// Beyond the feasible region: higher than the best by a slope that leads back to it.
  double wall(const VectorXd& t, std::vector<double>& gradient) {
    last_failed = true;
    const VectorXd from_best = (t - search.best()).cwiseQuotient(scale);
    for (std::size_t k = 0; k < gradient.size(); ++k) gradient[k] = 2 * from_best[k];
    return 2 * search.best_cost() / unit + 1 + from_best.squaredNorm();
  }

  double operator()(const std::vector<double>& y, std::vector<double>& gradient) {
    const VectorXd t = t_of(y);
    const ObjectiveEvaluation& evaluation = search.evaluate(t);
    if (search.was_stopped()) throw nlopt::forced_stop();
    if (evaluation.failed) return wall(t, gradient);
    const double cost = evaluation.cost;
    double norm = 0;
    if (!gradient.empty()) {
      const std::optional<VectorXd> g = search.gradient(t);
      if (!g) return wall(t, gradient);
      norm = g->norm();
      for (std::size_t k = 0; k < gradient.size(); ++k) gradient[k] = (*g)[k] * scale[k] / unit;
    }
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    history.push_back({.iteration = static_cast<int>(history.size()),
                       .evaluations = search.forward_runs(),
                       .cost = cost,
                       .gradient_norm = norm,
                       .step_norm = last_t.size() > 0 ? (t - last_t).norm() : 0,
                       .seconds = seconds.count(),
                       .values = search.values(t)});
    last_t = t;
    last_failed = false;
    if (callback) callback(history.back());
    return cost / unit;
  }

  static double call(const std::vector<double>& y, std::vector<double>& gradient, void* self) {
    return (*static_cast<ScaledObjective*>(self))(y, gradient);
  }
};

}  // namespace

OptimiserOutcome fit_with_nlopt(Search& search, const OptimiserOptions& options,
                                const FitIterationCallback& callback) {
  using Status = OptimiserOutcome::Status;
  OptimiserOutcome outcome;
  const VectorXd start = search.initial();
  outcome.t = search.all(start);
  outcome.cost = std::numeric_limits<double>::infinity();
  const int n = search.num_parameters();
  const ObjectiveEvaluation& first = search.evaluate(start);
  const std::optional<MatrixXd> jacobian = search.jacobian(start);
  if (!jacobian) {
    outcome.status = search.was_stopped() ? Status::stopped : Status::failed;
    outcome.detail = "the first run failed or could not be differentiated: " + first.failure;
    return outcome;
  }
  ScaledObjective objective{.search = search,
                            .callback = callback,
                            .start = start,
                            .scale = VectorXd::Ones(n),
                            .unit = std::max(first.cost, 1e-300),
                            .history = outcome.history};
  // A unit step then changes F by about its first value: Hessian diagonal JᵀJ scaled to 2F.
  for (int k = 0; k < n; ++k) {
    const double norm = jacobian->col(k).norm();
    if (norm > 0) objective.scale[k] = std::clamp(std::sqrt(2 * first.cost) / norm, 1e-6, 1.0);
  }
  nlopt::opt optimiser(nlopt::LD_SLSQP, n);
  std::vector<double> lower(n), upper(n), y(n, 0.0);
  for (int k = 0; k < n; ++k) {
    lower[k] = (search.lower()[k] - start[k]) / objective.scale[k];
    upper[k] = (search.upper()[k] - start[k]) / objective.scale[k];
  }
  optimiser.set_lower_bounds(lower);
  optimiser.set_upper_bounds(upper);
  optimiser.set_min_objective(ScaledObjective::call, &objective);
  // A gradient method creeps where Levenberg-Marquardt jumps: a small decrease says less.
  optimiser.set_ftol_rel(1e-2 * options.relative_decrease);
  optimiser.set_xtol_rel(options.step_tolerance);
  optimiser.set_maxeval(options.max_evaluations);
  double minimum = 0;
  try {
    const nlopt::result result = optimiser.optimize(y, minimum);
    outcome.status = result == nlopt::MAXEVAL_REACHED ? Status::max_evaluations : Status::converged;
    outcome.detail = "NLopt result " + std::to_string(static_cast<int>(result));
  } catch (const nlopt::forced_stop&) {
    outcome.status = Status::stopped;
    outcome.detail = "stopped";
  } catch (const nlopt::roundoff_limited&) {
    outcome.status = Status::converged;  // no further decrease within rounding
    outcome.detail = "limited by rounding";
  } catch (const std::invalid_argument& error) {  // how NLopt reports unusable bounds
    outcome.status = Status::failed;
    outcome.detail = std::string("NLopt: ") + error.what();
  } catch (const std::runtime_error& error) {
    outcome.status = Status::failed;
    outcome.detail = std::string("NLopt: ") + error.what();
  }
  if (outcome.status == Status::converged && objective.last_failed) {
    outcome.status = Status::failed;
    outcome.detail = "no step from the best point could be run: " + search.last_failure();
  }
  if (search.best().size() > 0) {
    outcome.t = search.all(search.best());
    outcome.cost = search.best_cost();
  }
  return outcome;
}

}  // namespace rhytid::fitting
