#include "tools/bench/stage_times.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

#include "adjoint/sweeps.h"
#include "sim/core/parallel.h"
#include "sim/terms/element_loop.h"
#include "tools/bench/skin_operations.h"
#include "tools/bench/timing.h"

namespace rhytid::tools {
namespace {

/// Takes element matrices and forgets them: what is left is their computation.
class NoSink final : public Term::MatrixSink {
 public:
  void add(const TermGroup&, int, double* dense) override { seen_ += dense[0]; }

 private:
  double seen_ = 0;
};

#if defined(__x86_64__)
/// Twelve independent chains of fused multiply-adds of packs; returns a number that depends on all.
template <class Pack>
[[gnu::always_inline]] inline double multiply_add_chains(long rounds) {
  Pack sum[12], factor = Pack{} + 0.999;
  for (int k = 0; k < 12; ++k) sum[k] = factor * (k + 1.0);
  for (long i = 0; i < rounds; ++i)
    for (int k = 0; k < 12; ++k) sum[k] = sum[k] * factor + factor;
  double total = 0;
  for (int k = 0; k < 12; ++k) total += sum[k][0] + sum[k][3];
  return total;
}
typedef double PackAvx2 __attribute__((vector_size(32)));
typedef double PackAvx512 __attribute__((vector_size(64)));
__attribute__((target("avx2,fma"))) double chains_avx2(long rounds) {
  return multiply_add_chains<PackAvx2>(rounds);
}
__attribute__((target("avx512f,fma,prefer-vector-width=512"))) double chains_avx512(long rounds) {
  return multiply_add_chains<PackAvx512>(rounds);
}

/// Operations per second of `threads` threads that run `chains` of packs of `width` at once.
double fma_rate(double (*chains)(long), int width, int threads) {
  constexpr long rounds = 200'000;
  constexpr int repeats = 50;
  std::vector<double> rates(static_cast<std::size_t>(threads)), kept = rates;
  parallel_for(threads, [&](std::int64_t t) {
    const auto at = static_cast<std::size_t>(t);
    for (int k = 0; k < repeats; ++k) {
      const double start = thread_seconds();
      kept[at] += chains(rounds);
      rates[at] = std::max(rates[at], 12. * width * 2 * rounds / (thread_seconds() - start));
    }
  });
  volatile double seen = kept[0];
  (void)seen;
  return std::accumulate(rates.begin(), rates.end(), 0.);
}
#endif

void measure_fma_rates(int threads, MachineLimits& limits) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    limits.fma_flops = limits.fma_flops_avx2 = fma_rate(chains_avx2, 4, threads);
  if (__builtin_cpu_supports("avx512f")) limits.fma_flops = fma_rate(chains_avx512, 8, threads);
#else
  (void)threads, (void)limits;
#endif
}

double read_rate(int threads) {
  const std::vector<double> big(std::size_t{32} << 20, 1.0);  // 256 MB
  std::vector<double> kept(static_cast<std::size_t>(threads));
  double seconds = std::numeric_limits<double>::infinity();
  for (int repeat = 0; repeat < 8; ++repeat) {
    const double start = clock_seconds();
    parallel_for(threads, [&](std::int64_t t) {
      const std::size_t blocks = big.size() / 8, count = static_cast<std::size_t>(threads),
                        at = static_cast<std::size_t>(t);
      double sum[8] = {};
      for (std::size_t i = 8 * (blocks * at / count); i < 8 * (blocks * (at + 1) / count); i += 8)
        for (std::size_t k = 0; k < 8; ++k) sum[k] += big[i + k];
      kept[at] = sum[0] + sum[7];
    });
    seconds = std::min(seconds, clock_seconds() - start);
  }
  volatile double seen = kept[0];
  (void)seen;
  return static_cast<double>(big.size()) * sizeof(double) / seconds;
}

/// Operations of a term of skin per call, where they are counted: viscoelastic skin without tension.
SkinOperations operations_of(const Term& term, const StepInfo& step, const TermStepData& data,
                             const VectorXd& u) {
  SkinOperations total;
  if (&term.kernels() != &skin_kernels()) return total;
  for (std::size_t gi = 0; gi < term.groups().size(); ++gi) {
    const TermGroup& g = term.groups()[gi];
    const TermElement e = term_element(term.kernels(), g, 0, step.dt(), data.theta[gi]);
    const SkinOperations one =
        count_skin_operations(term.law<SkinLaw>(), e.view, e.gather(u).data(),
                              data.prepared.data() + e.point * static_cast<std::size_t>(SkinLaw::np));
    total.residual += one.residual * g.num_elements * g.num_points;
    total.hessian += one.hessian * g.num_elements * g.num_points;
  }
  return total;
}

}  // namespace

MachineLimits measure_machine_limits(int threads) {
  const int before = num_threads();
  set_num_threads(threads);
  MachineLimits limits;
  measure_fma_rates(threads, limits);
  limits.read_bandwidth = read_rate(threads);
  set_num_threads(before);
  return limits;
}

std::optional<StageReport> measure_stages(const SceneModel& scene_model, double seconds,
                                          const std::function<bool()>& go_on) {
  const Model& model = scene_model.model();
  const VectorXd native = scene_model.native();
  StageReport report;
  report.nodes = model.num_nodes();
  report.unknowns = model.pattern().num_unknowns();
  for (const Term& term : model.terms) report.points += term.num_points();

  RunOptions options = scene_model.run_options();
  RunObserver observer;
  observer.iteration = [&](int, double, int, double, double) { return !go_on || go_on(); };
  const TermCounters before = model.terms.front().counters();
  const Trajectory run = simulate(model, native, options, observer);
  const TermCounters after = model.terms.front().counters();
  if (go_on && !go_on()) return std::nullopt;
  if (!run.complete) throw adjoint::GradientError("the run did not reach its last frame: " + run.failure);

  report.steps = static_cast<int>(run.steps.size());
  report.run_seconds = run.seconds;
  double factorisations = 0, single = 0, kept = 0;  // kept: iterations that a factor of before steers
  for (const StepRecord& record : run.steps) {
    report.iterations += record.report.iterations;
    factorisations += record.report.factorisations;
    single += record.report.single_factorisations;
    kept += record.report.lbfgs_iterations;
  }
  const auto per_step = [&](double count) { return count / report.steps; };
  const double prepares = per_step(static_cast<double>(after.prepare - before.prepare)),
               energies = per_step(static_cast<double>(after.energy - before.energy)),
               gradients = per_step(static_cast<double>(after.gradient - before.gradient)),
               hessians = per_step(static_cast<double>(after.hessian - before.hessian)),
               updates = per_step(static_cast<double>(after.update - before.update)),
               iterations = per_step(report.iterations);
  const int last = static_cast<int>(run.steps.size()) - 1;
  const State &old = run.before(last), &state = run.steps[static_cast<std::size_t>(last)].state;
  const StepInfo& step = run.steps[static_cast<std::size_t>(last)].step;
  StepProblem problem(model, native, step, old);
  const VectorXd q = model.to_unknowns(state.u);
  VectorXd gradient;
  bool stopped = false;
  const auto add = [&](StageTime stage, const std::function<void()>& call) {
    stopped = stopped || (go_on && !go_on());
    if (stopped) return;
    const ThreadTimes times = fastest_seconds_by_threads(seconds, call);
    stage.seconds = times.all;
    stage.one_thread = times.one;
    report.stages.push_back(stage);
  };
  const double points = report.points;

  add({.name = "old state", .calls = prepares}, [&] { (void)StepProblem(model, native, step, old); });
  add({.name = "energy", .calls = energies, .points = points}, [&] { (void)problem.energy(q, nullptr); });
  add({.name = "energy and gradient", .calls = gradients, .points = points},
      [&] { (void)problem.energy(q, &gradient); });
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const Term& term = model.terms[t];
    const double own = term.num_points();
    VectorXd force = VectorXd::Zero(state.u.size());
    const SkinOperations operations = operations_of(term, step, problem.data(t), state.u);
    add({.name = "gradient: " + term.name(), .points = own, .flops = operations.residual},
        [&] { (void)term.energy(step, problem.data(t), state.u, &force, nullptr); });
    NoSink sink;
    add({.name = "element Hessians: " + term.name(), .points = own, .flops = operations.hessian},
        [&] { term.hessian(step, problem.data(t), state.u, false, sink); });
  }
  BlockMatrix matrix(model.pattern());
  add({.name = "Hessian, assembled", .calls = hessians, .points = points},
      [&] { problem.hessian(q, Curvature::raw, matrix); });
  add({.name = "Hessian, projected", .points = points},
      [&] { problem.hessian(q, Curvature::projected, matrix); });
  problem.hessian(q, Curvature::raw, matrix);
  add({.name = "ordering", .is_serial = true}, [&] {
    std::vector<std::vector<int>> cliques;
    for (int c = 0; c < model.pattern().num_cliques(); ++c)
      cliques.emplace_back(model.pattern().clique(c).begin(), model.pattern().clique(c).end());
    (void)BlockPattern(model.pattern().num_blocks(), std::move(cliques));
  });
  add({.name = "analysis", .calls = per_step(1), .is_serial = true},
      [&] { (void)CholeskyFactor(model.pattern()); });
  CholeskyFactor factor(model.pattern());
  report.factor_entries = static_cast<double>(factor.factor_entries());
  report.factor_flops = factor.factor_flops();
  bool positive = true;
  add({.name = "factorisation", .calls = per_step(factorisations - single), .flops = factor.factor_flops()},
      [&] { positive = factor.factorize(matrix) && positive; });
  if (!positive)
    throw adjoint::GradientError("the Hessian at the end of the last step is not positive definite");
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  MatrixXd rhs(report.unknowns, 8);
  for (Eigen::Index i = 0; i < rhs.size(); ++i) rhs.data()[i] = normal(random);
  MatrixXd solution;
  // Forward and backward: the factor is read twice.
  const double factor_bytes = 2. * 8 * report.factor_entries;
  if (!stopped) {
    add({.name = "solve, 1 right-hand side", .calls = single > 0 ? 0 : iterations, .bytes = factor_bytes},
        [&] { solution = factor.solve(rhs.col(0)); });
    add({.name = "solve, 8 right-hand sides", .bytes = factor_bytes}, [&] { solution = factor.solve(rhs); });
  }
  add({.name = "factorisation, single", .calls = per_step(single), .flops = factor.factor_flops()},
      [&] { positive = factor.factorize(matrix, 0, Precision::single) && positive; });
  // On stiff matrices single precision may fail; a run then corrects no direction by it either.
  if (!stopped && factor.usable()) {
    // Iterations by a kept factor take one solve, those with a factor of their own a direction that is corrected.
    add({.name = "solve, single", .calls = single > 0 ? per_step(kept) : 0, .bytes = factor_bytes / 2},
        [&] { solution = factor.solve(rhs.col(0)); });
    add({.name = "direction, corrected", .calls = single > 0 ? iterations - per_step(kept) : 0},
        [&] { (void)factor.solve_iteratively(matrix, rhs.col(0), kDirectionTolerance, kMaxCorrections); });
  }
  add({.name = "matrix times vector",
       .bytes = 8. * static_cast<double>(matrix.values().size()),
       .is_serial = true},
      [&] { gradient = matrix.multiply(rhs.col(0)); });
  add({.name = "feasible step", .calls = iterations, .points = points},
      [&] { (void)problem.largest_feasible_step(q, 1e-3 * rhs.col(0)); });
  add({.name = "new state", .calls = updates, .points = points}, [&] { (void)problem.advance(state.u); });

  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const Term& term = model.terms[t];
    const std::size_t at = model.history_offset(t), size = term.history_size();
    const double own = term.num_points();
    VectorXd direction = VectorXd::Zero(native.size());
    direction.setRandom();
    const std::vector<const VectorXd*> natives(kDirections, &direction);
    using Block = Eigen::Matrix<double, Eigen::Dynamic, kDirections, Eigen::RowMajor>;
    const Block du = 1e-3 * Block::Ones(state.u.size(), kDirections);
    const Block ds = Block::Zero(static_cast<Eigen::Index>(size), kDirections);
    Block df = Block::Zero(state.u.size(), kDirections), ds_new = ds;
    Term::Directions directions;
    directions.count = kDirections;
    directions.du = directions.du_old = du.data();
    directions.ds_old = ds.data();
    directions.dnative = natives;
    add({.name = "tangent of 8: " + term.name(), .points = own}, [&] {
      term.tangent(step, problem.data(t), state.u, old.u, old.history.data() + at, directions, df.data(),
                   ds_new.data());
    });
    const VectorXd adj = model.to_displacement(VectorXd(rhs.col(0)));
    const VectorXd s_bar = VectorXd::Ones(static_cast<Eigen::Index>(size));
    VectorXd u_bar = VectorXd::Zero(state.u.size()), s_old_bar = s_bar, native_bar = 0 * native;
    add({.name = "adjoint: " + term.name(), .points = own}, [&] {
      term.adjoint_update(step, problem.data(t), state.u, s_bar.data(), u_bar);
      term.adjoint_step(step, problem.data(t), state.u, old.u, old.history.data() + at, adj, s_bar.data(),
                        u_bar, s_old_bar.data(), native_bar);
    });
  }
  if (stopped) return std::nullopt;
  return report;
}

}  // namespace rhytid::tools
