#include "tools/bench/stage_times.h"

#include <algorithm>
#include <chrono>
#include <random>

#include "adjoint/sweeps.h"

namespace rhytid::tools {
namespace {

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Median time of a call, of as many as fit into `seconds`, at least three.
double time_of(double seconds, const std::function<void()>& call) {
  std::vector<double> times;
  const double end = now() + seconds;
  while (times.size() < 3 || (now() < end && times.size() < 100000)) {
    const double start = now();
    call();
    times.push_back(now() - start);
  }
  std::nth_element(times.begin(), times.begin() + static_cast<long>(times.size() / 2), times.end());
  return times[times.size() / 2];
}

/// Takes element matrices and forgets them: what is left is their computation.
class NoSink final : public Term::MatrixSink {
 public:
  void add(const TermGroup&, int, double* dense) override { seen_ += dense[0]; }

 private:
  double seen_ = 0;
};

#if defined(__x86_64__)
/// Twelve independent chains of AVX2 fused multiply-adds; returns a number that depends on all.
__attribute__((target("avx2,fma"))) double multiply_add_chains(long rounds) {
  typedef double Pack __attribute__((vector_size(32)));
  Pack sum[12], factor = {0.999, 0.998, 0.997, 0.996};
  for (int k = 0; k < 12; ++k) sum[k] = factor * (k + 1.0);
  for (long i = 0; i < rounds; ++i)
    for (int k = 0; k < 12; ++k) sum[k] = sum[k] * factor + factor;
  double total = 0;
  for (int k = 0; k < 12; ++k) total += sum[k][0] + sum[k][3];
  return total;
}
#endif

double fma_rate() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    constexpr long rounds = 2'000'000;
    volatile double kept = 0;
    const double seconds = time_of(0.3, [&] { kept = multiply_add_chains(rounds); });
    (void)kept;
    return 12. * 4 * 2 * rounds / seconds;
  }
#endif
  return 0;
}

double read_rate() {
  const std::vector<double> big(std::size_t{32} << 20, 1.0);  // 256 MB
  volatile double kept = 0;
  const double seconds = time_of(0.3, [&] {
    double sum[8] = {};
    for (std::size_t i = 0; i < big.size(); i += 8)
      for (std::size_t k = 0; k < 8; ++k) sum[k] += big[i + k];
    kept = sum[0] + sum[7];
  });
  (void)kept;
  return static_cast<double>(big.size()) * sizeof(double) / seconds;
}

}  // namespace

MachineLimits measure_machine_limits() {
  return {fma_rate(), read_rate()};
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
  const Trajectory run = simulate(model, native, options, observer);
  if (go_on && !go_on()) return std::nullopt;
  if (!run.complete) throw adjoint::GradientError("the run did not reach its last frame: " + run.failure);

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
    stage.seconds = time_of(seconds, call);
    report.stages.push_back(stage);
  };
  const double points = report.points;

  add({.name = "old state"}, [&] { (void)StepProblem(model, native, step, old); });
  add({.name = "energy", .points = points}, [&] { (void)problem.energy(q, nullptr); });
  add({.name = "energy and gradient", .points = points}, [&] { (void)problem.energy(q, &gradient); });
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const Term& term = model.terms[t];
    const double own = term.num_points();
    VectorXd force = VectorXd::Zero(state.u.size());
    add({.name = "gradient: " + term.name(), .points = own},
        [&] { (void)term.energy(step, problem.data(t), state.u, &force, nullptr); });
    NoSink sink;
    add({.name = "element Hessians: " + term.name(), .points = own},
        [&] { term.hessian(step, problem.data(t), state.u, false, sink); });
  }
  BlockMatrix matrix(model.pattern());
  add({.name = "Hessian, assembled", .points = points}, [&] { problem.hessian(q, Curvature::raw, matrix); });
  add({.name = "Hessian, projected", .points = points},
      [&] { problem.hessian(q, Curvature::projected, matrix); });
  problem.hessian(q, Curvature::raw, matrix);
  add({.name = "ordering"}, [&] {
    std::vector<std::vector<int>> cliques;
    for (int c = 0; c < model.pattern().num_cliques(); ++c)
      cliques.emplace_back(model.pattern().clique(c).begin(), model.pattern().clique(c).end());
    (void)BlockPattern(model.pattern().num_blocks(), std::move(cliques));
  });
  add({.name = "analysis"}, [&] { (void)CholeskyFactor(model.pattern()); });
  CholeskyFactor factor(model.pattern());
  report.factor_entries = static_cast<double>(factor.factor_entries());
  report.factor_flops = factor.factor_flops();
  bool positive = true;
  add({.name = "factorisation", .flops = factor.factor_flops()},
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
    add({.name = "solve, 1 right-hand side", .bytes = factor_bytes},
        [&] { solution = factor.solve(rhs.col(0)); });
    add({.name = "solve, 8 right-hand sides", .bytes = factor_bytes}, [&] { solution = factor.solve(rhs); });
  }
  add({.name = "matrix times vector", .bytes = 8. * static_cast<double>(matrix.values().size())},
      [&] { gradient = matrix.multiply(rhs.col(0)); });
  add({.name = "feasible step", .points = points},
      [&] { (void)problem.largest_feasible_step(q, 1e-3 * rhs.col(0)); });
  add({.name = "new state", .points = points}, [&] { (void)problem.advance(state.u); });

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
