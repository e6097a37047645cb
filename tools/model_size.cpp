#include "tools/model_size.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "sim/core/parallel.h"
#include "sim/time/model.h"
#include "tools/bench/timing.h"

namespace rhytid::tools {
namespace {

/// Fastest of some calls, which are one when it takes long.
double fastest_seconds(double (*clock)(), const std::function<void()>& call) {
  constexpr double quick = 0.05;
  constexpr int rounds = 5;
  double fastest = std::numeric_limits<double>::infinity();
  for (int round = 0; round == 0 || (round < rounds && fastest < quick); ++round) {
    const double start = clock();
    call();
    fastest = std::min(fastest, clock() - start);
  }
  return fastest;
}

/// Seconds of a call on cores of its own: the processor's time on one thread, or less where several threads are
/// faster now. (Where others have the cores, several only look slower.)
double seconds_of(const std::function<void()>& call) {
  const int threads = num_threads();
  set_num_threads(1);
  double seconds = fastest_seconds(thread_seconds, call);
  set_num_threads(threads);
  if (threads > 1) seconds = std::min(seconds, fastest_seconds(clock_seconds, call));
  return seconds;
}

/// Whether the solver goes by factors in single precision (sim/solve/README.md, "Mixed precision").
bool steers_by_single_precision(const MinimiserOptions& options, const CholeskyFactor& factor) {
  return options.method != Minimiser::lbfgs_literal &&
         (options.precision == FactorPrecision::mixed ||
          (options.precision == FactorPrecision::automatic && factor.factor_flops() >= kMixedFromFlops));
}

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
  // Colliders stand where their paths begin: a step that ends at time 0 asks about the rest state itself, and where
  // the skin settles first, about the same with its held parts moved.
  const StepInfo step{0, -1 / (time.frame_rate * time.substeps), 0};
  const State rest = model.rest_state();
  StepCost cost;
  BlockMatrix matrix(model.pattern());
  const double start = thread_seconds();
  CholeskyFactor factor(model.pattern());
  cost.analysis_seconds = thread_seconds() - start;

  StepProblem problem(model, model.native, step, rest);
  const VectorXd u =
      scene_model.run_options().settle ? problem.displacement(model.to_unknowns(rest.u)) : rest.u;
  VectorXd gradient = VectorXd::Zero(model.to_unknowns(u).size());
  const double energy = problem.energy_at(u, &gradient);
  cost.rest_residual = std::isfinite(energy) ? gradient.norm() : std::numeric_limits<double>::infinity();
  cost.residual_seconds = seconds_of([&] { problem.energy_at(u, &gradient); });
  cost.state_seconds = seconds_of([&] {
    (void)StepProblem(model, model.native, step, rest);
    (void)problem.advance(rest.u);
  });
  if (!std::isfinite(energy)) return cost;
  cost.hessian_seconds = seconds_of([&] { problem.hessian_at(u, Curvature::raw, matrix); });
  const VectorXd force = VectorXd::Ones(gradient.size());
  cost.factor_seconds = seconds_of([&] { cost.positive_definite = factor.factorize(matrix); });
  cost.factor_entries = factor.factor_entries();
  if (!cost.positive_definite) return cost;
  cost.smallest_pivot = factor.smallest_pivot();
  cost.largest_pivot = factor.largest_pivot();
  cost.direction_seconds = cost.solve_seconds = seconds_of([&] { (void)factor.solve(force); });
  const MinimiserOptions& options = scene_model.run_options().minimiser;
  if (!steers_by_single_precision(options, factor)) return cost;
  bool single = true;
  const double factor_seconds =
      seconds_of([&] { single = factor.factorize(matrix, 0, Precision::single) && single; });
  if (!factor.usable()) return cost;
  const double solve_seconds = seconds_of([&] { (void)factor.solve(force); });
  const double direction_seconds = seconds_of([&] {
    single =
        single && factor.solve_iteratively(matrix, force, kDirectionTolerance, kMaxCorrections).has_value();
  });
  if (single) {
    cost.factor_seconds = factor_seconds;
    cost.solve_seconds = solve_seconds;
    cost.direction_seconds = direction_seconds;
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
  // One chunk of dense element matrices, or two of 32 each (Term::hessian).
  for (const Term& term : model.terms)
    for (const TermGroup& g : term.groups()) {
      const double side = 3. * g.num_nodes, matrices = g.num_elements <= 32 ? g.num_elements : 64;
      m.elements = std::max(m.elements, matrices * side * side * sizeof(double) / 1e6);
    }
  // Old and new state, and what the step prepared from the old one.
  m.states = 2 * static_cast<double>(3 * size.nodes + size.history) * sizeof(double) / 1e6 + prepared;
  return m;
}

}  // namespace rhytid::tools
