#include "tools/bench/gradient_cost.h"

#include <algorithm>
#include <cmath>

#include "adjoint/certificate.h"
#include "adjoint/parameter_space.h"
#include "tools/bench/timing.h"

namespace rhytid::tools {
namespace {

template <class F>
double seconds_of(F&& f) {
  const double start = clock_seconds();
  f();
  return clock_seconds() - start;
}

}  // namespace

MatrixXd parameter_columns(const SceneModel& scene_model, int count) {
  std::vector<std::string> addresses;
  for (const ParameterSpec& spec : all_parameters(scene_model.scene())) addresses.push_back(spec.address);
  const adjoint::ParameterSpace space(scene_model, addresses);
  MatrixXd columns(space.jacobian().rows(), 0);
  for (int k = 0; k < space.size() && columns.cols() < count; ++k) {
    if (space.jacobian().col(k).squaredNorm() == 0) continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols(1) = space.jacobian().col(k);
  }
  return columns;
}

std::optional<GradientCost> measure_gradient_cost(const SceneModel& scene_model,
                                                  const GradientCostOptions& options,
                                                  const CostProgress& progress) {
  const Model& model = scene_model.model();
  const VectorXd& native = scene_model.native();
  const auto go_on = [&](const std::string& part) { return !progress || progress(part); };
  GradientCost cost;
  cost.nodes = model.num_nodes();
  cost.unknowns = model.pattern().num_unknowns();
  for (const Term& term : model.terms) cost.points += term.num_points();
  const MatrixXd columns = parameter_columns(scene_model, options.parameters);
  cost.columns = static_cast<int>(columns.cols());
  const auto output = adjoint::default_output(model, options.points);

  const RunOptions own = scene_model.run_options();
  RunOptions tight = own;
  tight.minimiser = adjoint::certificate_minimiser(own.minimiser);
  RunObserver observer;
  observer.iteration = [&](int, double, int, double, double) { return go_on(""); };

  std::vector<double> forward, forward_tight, adjoint_time, jacobian;
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    if (!go_on("simulation")) return std::nullopt;
    Trajectory run;
    forward.push_back(seconds_of([&] { run = simulate(model, native, own, observer); }));
    if (!go_on("")) return std::nullopt;
    if (!run.complete) throw adjoint::GradientError("the run did not reach its last frame: " + run.failure);
    cost.steps = static_cast<int>(run.steps.size());
    cost.iterations = cost.factorisations = 0;
    for (const StepRecord& record : run.steps) {
      cost.iterations += record.report.iterations;
      cost.factorisations += record.report.factorisations;
    }
    if (!go_on("simulation, tight")) return std::nullopt;
    forward_tight.push_back(seconds_of([&] { run = simulate(model, native, tight, observer); }));
    if (!go_on("")) return std::nullopt;
    cost.tight_iterations = 0;
    for (const StepRecord& record : run.steps) cost.tight_iterations += record.report.iterations;
    const std::vector<VectorXd> weights = adjoint::random_weights(*output, run.frames(), 1);
    if (!go_on("adjoint")) return std::nullopt;
    adjoint::AdjointResult gradient;
    adjoint_time.push_back(
        seconds_of([&] { gradient = adjoint::adjoint_sweep(model, native, run, *output, weights); }));
    if (!go_on("Jacobian")) return std::nullopt;
    adjoint::TangentResult tangent;
    jacobian.push_back(
        seconds_of([&] { tangent = adjoint::tangent_sweep(model, native, run, *output, columns); }));
    for (Eigen::Index k = 0; k < columns.cols(); ++k) {
      double forward_sum = 0, size = 0;
      for (std::size_t f = 0; f < weights.size(); ++f) {
        if (tangent.frames[f].rows() == 0) continue;
        forward_sum += weights[f].dot(tangent.frames[f].col(k));
        size += weights[f].cwiseAbs().dot(tangent.frames[f].col(k).cwiseAbs());
      }
      const double backward = gradient.native_bar.dot(columns.col(k));
      if (size > 0) cost.duality = std::max(cost.duality, std::abs(forward_sum - backward) / size);
    }
  }
  cost.forward = median(forward);
  cost.forward_tight = median(forward_tight);
  cost.adjoint = median(adjoint_time);
  cost.jacobian = median(jacobian);
  return cost;
}

}  // namespace rhytid::tools
