#include "tools/model_size.h"

#include <chrono>

#include "sim/time/model.h"

namespace rhytid::tools {
namespace {

class Stopwatch {
 public:
  /// Seconds since the last lap or the construction.
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace

ModelSize model_size(const SceneModel& scene_model) {
  const Model& model = scene_model.model();
  ModelSize size;
  size.faces = model.mesh.num_faces;
  size.columns = model.mesh.num_columns;
  size.levels = model.mesh.num_levels;
  size.nodes = model.mesh.num_nodes();
  size.elements = model.mesh.num_elements();
  size.unknowns = model.pattern().num_unknowns() - static_cast<int>(model.constraints.fixed_unknowns.size());
  size.history = model.history_size();
  size.matrix_entries = model.pattern().num_entries();
  for (const Term& term : model.terms) {
    TermSize t;
    t.name = term.name();
    t.points = term.num_points();
    t.history = term.history_size();
    for (const TermGroup& g : term.groups()) t.points_per_element.push_back(g.num_points);
    size.terms.push_back(std::move(t));
  }
  return size;
}

StepCost measure_step_cost(const SceneModel& scene_model) {
  const Model& model = scene_model.model();
  const TimeScene& time = scene_model.scene().time;
  // Colliders stand where they stand at time 0: a step that ends there asks about the rest state itself.
  const StepInfo step{0, -1 / (time.frame_rate * time.substeps), 0};
  const State rest = model.rest_state();
  StepCost cost;
  Stopwatch watch;
  BlockMatrix matrix(model.pattern());
  CholeskyFactor factor(model.pattern());
  cost.analysis_seconds = watch.lap();

  StepProblem problem(model, model.native, step, rest);
  const VectorXd q = model.to_unknowns(rest.u);
  VectorXd gradient = VectorXd::Zero(q.size());
  problem.energy(q, &gradient);  // the first one also touches the memory for the first time
  watch.lap();
  problem.energy(q, &gradient);
  cost.residual_seconds = watch.lap();
  cost.rest_residual = gradient.norm();
  problem.hessian(q, Curvature::raw, matrix);
  cost.hessian_seconds = watch.lap();
  cost.positive_definite = factor.factorize(matrix);
  cost.factor_seconds = watch.lap();
  cost.factor_entries = factor.factor_entries();
  if (cost.positive_definite) {
    cost.smallest_pivot = factor.smallest_pivot();
    cost.largest_pivot = factor.largest_pivot();
    watch.lap();
    const VectorXd direction = factor.solve(VectorXd::Ones(q.size()));
    cost.solve_seconds = watch.lap();
  }
  return cost;
}

MemoryEstimate memory_estimate(const SceneModel& scene_model, const ModelSize& size,
                               std::size_t factor_entries) {
  const Model& model = scene_model.model();
  MemoryEstimate m;
  double prepared = 0;
  for (const Term& term : model.terms) {
    m.model += static_cast<double>(term.bytes()) / 1e6;
    prepared += static_cast<double>(term.num_points()) * term.kernels().np * sizeof(double) / 1e6;
  }
  // The pattern keeps, besides the row indices, where each clique's block pairs go.
  double pairs = 0;
  for (int c = 0; c < model.pattern().num_cliques(); ++c) {
    const double n = static_cast<double>(model.pattern().clique(c).size());
    pairs += n * (n + 1) / 2;
  }
  m.model += pairs * sizeof(int) / 1e6;
  m.matrix = static_cast<double>(size.matrix_entries) * (sizeof(double) + sizeof(int)) / 1e6;
  m.factor = static_cast<double>(factor_entries) * sizeof(double) / 1e6;
  // Old and new state, and what the step prepared from the old one.
  m.states = 2 * static_cast<double>(3 * size.nodes + size.history) * sizeof(double) / 1e6 + prepared;
  return m;
}

}  // namespace rhytid::tools
