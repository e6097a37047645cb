#include "adjoint/sweeps.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "adjoint/resimulate.h"
#include "sim/core/error.h"
#include "sim/time/step_passes.h"

namespace rhytid::adjoint {

namespace {

constexpr int D = kDirections;
using Block = Eigen::Matrix<double, Eigen::Dynamic, D, Eigen::RowMajor>;

std::string where(const StepRecord& record) {
  return "step " + std::to_string(record.step.index) + " (t = " + std::to_string(record.step.t) + " s): ";
}

void check_run(const Trajectory& run) {
  if (!run.complete) throw GradientError("the run did not reach its last frame: " + run.failure);
  for (const StepRecord& record : run.steps) {
    if (record.state.u.size() == 0) throw GradientError("the run kept no states");
    if (!record.report.converged())
      throw GradientError(where(record) + "did not converge (" + name(record.report.status) + ", residual " +
                          std::to_string(record.report.residual) + " N)");
  }
}

/// Factors the raw Hessian of a pass over a step where it ended, u; returns the residual there.
VectorXd factor_at(StepProblem& problem, const VectorXd& u, const StepRecord& record, BlockMatrix& matrix,
                   CholeskyFactor& factor) {
  const VectorXd q = problem.model().to_unknowns(u);
  VectorXd residual;
  if (!std::isfinite(problem.energy(q, &residual)))
    throw GradientError(where(record) + "its state lies outside the domain for these parameters");
  problem.hessian(q, Curvature::raw, matrix);
  if (!factor.factorize(matrix))
    throw GradientError(where(record) + "the Hessian at the converged state is not positive definite");
  return residual;
}

/// The same for the end of a step, with its entries of the report.
void factor_step(StepProblem& problem, const StepRecord& record, BlockMatrix& matrix, CholeskyFactor& factor,
                 SweepReport& report, VectorXd* residual) {
  const VectorXd r = factor_at(problem, record.state.u, record, matrix, factor);
  report.smallest_pivot.push_back(factor.smallest_pivot());
  report.largest_pivot.push_back(factor.largest_pivot());
  report.residual.push_back(r.norm());
  if (residual) *residual = r;
}

bool lags(const Term& term) {
  return term.kernels().history_is_lag;
}

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct TangentPair {
  Block du, ds;
};

/// Derivatives of a pass's end from those of its start, for one chunk of directions; the factor is that of
/// the pass. `only_lag`: of the history only what lags is advanced, the rest stays as at the start.
TangentPair advance_tangent(const StepProblem& problem, const VectorXd& u, const CholeskyFactor& factor,
                            const std::vector<const VectorXd*>& dnative, const Block& du, const Block& ds,
                            bool only_lag) {
  const Model& model = problem.model();
  const VectorXd &u_old = problem.old().u, &s_old = problem.old().history;
  Term::Directions dir;
  dir.count = static_cast<int>(dnative.size());
  dir.du_old = du.data();
  dir.dnative = dnative;
  Block dr = Block::Zero(du.rows(), D);
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const std::size_t at = model.history_offset(t);
    dir.ds_old = ds.data() + at * D;
    model.terms[t].tangent(problem.step(), problem.data(t), u, u_old, s_old.data() + at, dir, dr.data(),
                           nullptr);
  }
  // Nodes that the clock moves pull at the others.
  const auto moves_clock = [&model](const VectorXd* direction) { return (*direction)[model.clock] != 0; };
  const bool is_asked = model.clock >= 0 && std::any_of(dir.dnative.begin(), dir.dnative.end(), moves_clock);
  const VectorXd by_clock = is_asked ? problem.given_by_clock() : VectorXd();
  Block given;
  if (by_clock.size() > 0) {
    const VectorXd pull = problem.hessian_times(u, by_clock);
    given = Block::Zero(du.rows(), D);
    for (int k = 0; k < dir.count; ++k) {
      given.col(k) = (*dnative[k])[model.clock] * by_clock;
      dr.col(k) += (*dnative[k])[model.clock] * pull;
    }
  }
  const MatrixXd dq = factor.solve(-model.to_unknowns(MatrixXd(dr.leftCols(dir.count))));
  TangentPair next{Block::Zero(du.rows(), D), only_lag ? ds : Block::Zero(ds.rows(), D)};
  next.du.leftCols(dir.count) = model.to_displacement(dq);
  if (given.size() > 0) next.du += given;
  dir.du = next.du.data();
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    if (only_lag && !lags(model.terms[t])) continue;
    const std::size_t at = model.history_offset(t);
    dir.ds_old = ds.data() + at * D;
    model.terms[t].tangent(problem.step(), problem.data(t), u, u_old, s_old.data() + at, dir, nullptr,
                           next.ds.data() + at * D);
  }
  return next;
}

/// Adjoint of a pass: from s_bar, the derivative by what it leaves, and its right-hand side adds to u_old_bar
/// and native_bar and returns the derivative by the history at its start; adj_q is the solution.
VectorXd retreat_adjoint(const StepProblem& problem, const VectorXd& u, const CholeskyFactor& factor,
                         VectorXd rhs, const VectorXd& s_bar, VectorXd& u_old_bar, VectorXd& native_bar,
                         VectorXd& adj_q) {
  const Model& model = problem.model();
  for (std::size_t t = 0; t < model.terms.size(); ++t)
    model.terms[t].adjoint_update(problem.step(), problem.data(t), u, s_bar.data() + model.history_offset(t),
                                  rhs);
  adj_q = factor.solve(model.to_unknowns(rhs)).col(0);
  const VectorXd adj = model.to_displacement(adj_q);
  if (const VectorXd by_clock = problem.given_by_clock(); by_clock.size() > 0)
    native_bar[model.clock] += by_clock.dot(rhs) - problem.hessian_times(u, by_clock).dot(adj);
  VectorXd s_old_bar = VectorXd::Zero(s_bar.size());
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    const std::size_t at = model.history_offset(t);
    model.terms[t].adjoint_step(problem.step(), problem.data(t), u, problem.old().u,
                                problem.old().history.data() + at, adj, s_bar.data() + at, u_old_bar,
                                s_old_bar.data() + at, native_bar);
  }
  return s_old_bar;
}

long count_changes(const std::vector<signed char>& a, const std::vector<signed char>& b) {
  long count = 0;
  for (std::size_t q = 0; q < a.size(); ++q) count += a[q] != b[q];
  return count;
}

/// Splits a history into what lags (returned; zero elsewhere) and the rest (kept; zero where it lags).
VectorXd take_lag(const Model& model, VectorXd& history) {
  VectorXd lag = VectorXd::Zero(history.size());
  for (std::size_t t = 0; t < model.terms.size(); ++t) {
    if (!lags(model.terms[t])) continue;
    const auto at = static_cast<Eigen::Index>(model.history_offset(t)),
               size = static_cast<Eigen::Index>(model.terms[t].history_size());
    lag.segment(at, size) = history.segment(at, size);
    history.segment(at, size).setZero();
  }
  return lag;
}

}  // namespace

std::vector<double> SweepReport::relative_pivots() const {
  std::vector<double> ratio;
  for (std::size_t i = 0; i < smallest_pivot.size(); ++i)
    ratio.push_back(smallest_pivot[i] / largest_pivot[i]);
  if (ratio.empty()) return ratio;
  std::vector<double> sorted = ratio;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<long>(sorted.size() / 2), sorted.end());
  const double median = sorted[sorted.size() / 2];
  for (double& r : ratio) r = median > 0 ? r / median : 0;
  return ratio;
}

std::vector<int> SweepReport::near_singular_steps(double dip) const {
  const std::vector<double> pivots = relative_pivots();
  std::vector<int> steps;
  for (std::size_t i = 0; i < pivots.size(); ++i)
    if (pivots[i] < dip) steps.push_back(static_cast<int>(i));
  return steps;
}

TangentResult tangent_sweep(const Model& model, const VectorXd& native, const Trajectory& run,
                            const Output& output, const MatrixXd& directions) {
  check_run(run);
  require(directions.rows() == native.size(), "tangent_sweep: one row per native parameter");
  const double start = now();
  const int count = static_cast<int>(directions.cols()), chunks = (count + D - 1) / D;
  const Eigen::Index nu = 3 * model.num_nodes(), nh = static_cast<Eigen::Index>(model.history_size());
  std::vector<VectorXd> columns;
  for (int k = 0; k < count; ++k) columns.push_back(directions.col(k));
  std::vector<Block> du(chunks, Block::Zero(nu, D)), ds(chunks, Block::Zero(nh, D));
  TangentResult result;
  const bool starts_at_rest = run.frame_end.front() == 0;  // else a settling step leads to frame 0
  if (starts_at_rest)
    result.frames.push_back(MatrixXd::Zero(output.size(0), count));  // rest depends on nothing
  const auto directions_of = [&](int chunk) {
    std::vector<const VectorXd*> list;
    for (int k = chunk * D; k < std::min(count, chunk * D + D); ++k) list.push_back(&columns[k]);
    return list;
  };

  BlockMatrix matrix(model.pattern());
  CholeskyFactor factor(model.pattern());
  int frame = starts_at_rest ? 1 : 0;
  SharedState old = first_state(run);
  std::vector<signed char> regimes;
  for (int i = 0; i < static_cast<int>(run.steps.size()); ++i) {
    const StepRecord& record = run.steps[i];
    StepPasses passes(model, native, record.step, *old, record.earlier_passes);
    SharedState state = state_after(run, i, passes);
    // Every pass is a step of its own from the same state but for the lag, which it hands to the next.
    for (int j = 0; j + 1 < passes.count(); ++j) {
      StepProblem& pass = passes.pass(j);
      const VectorXd& u = record.earlier_passes[static_cast<std::size_t>(j)];
      (void)factor_at(pass, u, record, matrix, factor);
      for (int c = 0; c < chunks; ++c)
        ds[c] = advance_tangent(pass, u, factor, directions_of(c), du[c], ds[c], true).ds;
    }
    factor_step(passes.last(), record, matrix, factor, result.report, nullptr);
    const int first_frame = frame;
    for (; frame <= run.frames() && run.frame_end[frame] == i + 1; ++frame)
      result.frames.emplace_back(output.size(frame), count);
    for (int c = 0; c < chunks; ++c) {
      TangentPair next =
          advance_tangent(passes.last(), record.state.u, factor, directions_of(c), du[c], ds[c], false);
      const int width = std::min(D, count - c * D);
      for (int f = first_frame; f < frame; ++f) {
        if (output.size(f) == 0) continue;
        result.frames[f].middleCols(c * D, width) =
            output.step_tangent(f, passes.last(), *state,
                                {next.du.leftCols(width), next.ds.leftCols(width), du[c].leftCols(width),
                                 ds[c].leftCols(width), directions.middleCols(c * D, width)});
      }
      du[c] = std::move(next.du);
      ds[c] = std::move(next.ds);
    }
    std::vector<signed char> now_on = step_regimes(passes.last(), record.state.u);
    result.report.regime_changes.push_back(i > 0 ? count_changes(regimes, now_on) : 0);
    regimes = std::move(now_on);
    old = std::move(state);
  }
  result.report.seconds = now() - start;
  return result;
}

AdjointResult adjoint_sweep(const Model& model, const VectorXd& native, const Trajectory& run,
                            const Output& output, const std::vector<VectorXd>& weights) {
  return adjoint_sweep_within(ReverseStates::unlimited, model, native, run, output, weights);
}

AdjointResult adjoint_sweep_within(std::size_t budget_bytes, const Model& model, const VectorXd& native,
                                   const Trajectory& run, const Output& output,
                                   const std::vector<VectorXd>& weights) {
  check_run(run);
  require(static_cast<int>(weights.size()) == run.frames() + 1, "adjoint_sweep: weights for every frame");
  const double start = now();
  const Eigen::Index nu = 3 * model.num_nodes(), nh = static_cast<Eigen::Index>(model.history_size());
  AdjointResult result;
  result.native_bar = VectorXd::Zero(native.size());
  VectorXd u_bar = VectorXd::Zero(nu), s_bar = VectorXd::Zero(nh);
  BlockMatrix matrix(model.pattern());
  CholeskyFactor factor(model.pattern());
  int frame = run.frames();
  const int num_steps = static_cast<int>(run.steps.size());
  ReverseStates states(model, native, run, budget_bytes);
  SharedState state = states.after(num_steps);
  std::vector<signed char> regimes;
  for (int i = num_steps - 1; i >= 0; --i) {
    const StepRecord& record = run.steps[i];
    SharedState old = states.after(i);
    StepPasses passes(model, native, record.step, *old, record.earlier_passes);
    VectorXd residual, adj_q, u_old_bar = VectorXd::Zero(nu), s_old_bar = VectorXd::Zero(nh);
    StepBars bars{u_bar, s_bar, u_old_bar, s_old_bar, result.native_bar};
    for (; frame >= 0 && run.frame_end[frame] == i + 1; --frame)
      if (output.size(frame) > 0) output.step_adjoint(frame, passes.last(), *state, weights[frame], bars);
    factor_step(passes.last(), record, matrix, factor, result.report, &residual);
    s_old_bar += retreat_adjoint(passes.last(), record.state.u, factor, u_bar, s_bar, u_old_bar,
                                 result.native_bar, adj_q);
    result.residual_error += adj_q.dot(residual);
    // Back through the earlier passes: each left the lag that the next started from, and nothing else.
    for (int j = passes.count() - 2; j >= 0; --j) {
      const VectorXd lag_bar = take_lag(model, s_old_bar);
      const VectorXd& u = record.earlier_passes[static_cast<std::size_t>(j)];
      const VectorXd left = factor_at(passes.pass(j), u, record, matrix, factor);
      s_old_bar += retreat_adjoint(passes.pass(j), u, factor, VectorXd::Zero(nu), lag_bar, u_old_bar,
                                   result.native_bar, adj_q);
      result.residual_error += adj_q.dot(left);
    }
    u_bar = std::move(u_old_bar);
    s_bar = std::move(s_old_bar);
    std::vector<signed char> now_on = step_regimes(passes.last(), record.state.u);
    if (i + 1 < num_steps) result.report.regime_changes.push_back(count_changes(now_on, regimes));
    regimes = std::move(now_on);
    state = std::move(old);
  }
  if (num_steps > 0) result.report.regime_changes.push_back(0);
  result.checkpoints = states.report();
  // Reports run from the first step to the last.
  for (auto* list : {&result.report.smallest_pivot, &result.report.largest_pivot, &result.report.residual})
    std::reverse(list->begin(), list->end());
  std::reverse(result.report.regime_changes.begin(), result.report.regime_changes.end());
  result.report.seconds = now() - start;
  return result;
}

}  // namespace rhytid::adjoint
