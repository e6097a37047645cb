#include "adjoint/sweeps.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "sim/core/error.h"

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

/// Factors the raw Hessian of a step at its converged state.
void factor_step(StepProblem& problem, const StepRecord& record, BlockMatrix& matrix, CholeskyFactor& factor,
                 SweepReport& report, VectorXd* residual) {
  const VectorXd q = problem.model().to_unknowns(record.state.u);
  VectorXd r;
  if (!std::isfinite(problem.energy(q, &r)))
    throw GradientError(where(record) + "its state lies outside the domain for these parameters");
  problem.hessian(q, Curvature::raw, matrix);
  if (!factor.factorize(matrix))
    throw GradientError(where(record) + "the Hessian at the converged state is not positive definite");
  report.smallest_pivot.push_back(factor.smallest_pivot());
  report.largest_pivot.push_back(factor.largest_pivot());
  report.residual.push_back(r.norm());
  if (residual) *residual = r;
}

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

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
  const auto record_frame = [&](int frame, const State& state) {
    MatrixXd out(output.size(frame), count);
    for (int c = 0; c < chunks && out.rows() > 0; ++c) {
      const int width = std::min(D, count - c * D);
      out.middleCols(c * D, width) =
          output.tangent(frame, state, MatrixXd(du[c].leftCols(width)), MatrixXd(ds[c].leftCols(width)));
    }
    result.frames.push_back(std::move(out));
  };
  const bool starts_at_rest = run.frame_end.front() == 0;  // else a settling step leads to frame 0
  if (starts_at_rest) record_frame(0, run.initial);

  BlockMatrix matrix(model.pattern());
  CholeskyFactor factor(model.pattern());
  int frame = starts_at_rest ? 1 : 0;
  for (int i = 0; i < static_cast<int>(run.steps.size()); ++i) {
    const StepRecord& record = run.steps[i];
    const State& old = run.before(i);
    StepProblem problem(model, native, record.step, old);
    factor_step(problem, record, matrix, factor, result.report, nullptr);
    for (int c = 0; c < chunks; ++c) {
      Term::Directions dir;
      dir.count = std::min(D, count - c * D);
      dir.du_old = du[c].data();
      for (int k = 0; k < dir.count; ++k) dir.dnative.push_back(&columns[c * D + k]);
      Block dr = Block::Zero(nu, D);
      for (std::size_t t = 0; t < model.terms.size(); ++t) {
        dir.ds_old = ds[c].data() + model.history_offset(t) * D;
        model.terms[t].tangent(record.step, problem.data(t), record.state.u, old.u,
                               old.history.data() + model.history_offset(t), dir, dr.data(), nullptr);
      }
      const MatrixXd dq = factor.solve(-model.to_unknowns(MatrixXd(dr.leftCols(dir.count))));
      Block du_new = Block::Zero(nu, D), ds_new = Block::Zero(nh, D);
      du_new.leftCols(dir.count) = model.to_displacement(dq);
      dir.du = du_new.data();
      for (std::size_t t = 0; t < model.terms.size(); ++t) {
        dir.ds_old = ds[c].data() + model.history_offset(t) * D;
        model.terms[t].tangent(record.step, problem.data(t), record.state.u, old.u,
                               old.history.data() + model.history_offset(t), dir, nullptr,
                               ds_new.data() + model.history_offset(t) * D);
      }
      du[c] = std::move(du_new);
      ds[c] = std::move(ds_new);
    }
    for (; frame <= run.frames() && run.frame_end[frame] == i + 1; ++frame) record_frame(frame, record.state);
  }
  result.report.seconds = now() - start;
  return result;
}

AdjointResult adjoint_sweep(const Model& model, const VectorXd& native, const Trajectory& run,
                            const Output& output, const std::vector<VectorXd>& weights) {
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
  for (int i = static_cast<int>(run.steps.size()) - 1; i >= 0; --i) {
    const StepRecord& record = run.steps[i];
    const State& old = run.before(i);
    for (; frame >= 0 && run.frame_end[frame] == i + 1; --frame)
      if (output.size(frame) > 0) output.adjoint(frame, record.state, weights[frame], u_bar, s_bar);
    StepProblem problem(model, native, record.step, old);
    VectorXd residual;
    factor_step(problem, record, matrix, factor, result.report, &residual);
    VectorXd rhs = u_bar;
    for (std::size_t t = 0; t < model.terms.size(); ++t)
      model.terms[t].adjoint_update(record.step, problem.data(t), record.state.u,
                                    s_bar.data() + model.history_offset(t), rhs);
    const VectorXd adj_q = factor.solve(model.to_unknowns(rhs)).col(0);
    result.residual_error += adj_q.dot(residual);
    const VectorXd adj = model.to_displacement(adj_q);
    VectorXd u_old_bar = VectorXd::Zero(nu), s_old_bar = VectorXd::Zero(nh);
    for (std::size_t t = 0; t < model.terms.size(); ++t) {
      const std::size_t at = model.history_offset(t);
      model.terms[t].adjoint_step(record.step, problem.data(t), record.state.u, old.u,
                                  old.history.data() + at, adj, s_bar.data() + at, u_old_bar,
                                  s_old_bar.data() + at, result.native_bar);
    }
    u_bar = std::move(u_old_bar);
    s_bar = std::move(s_old_bar);
  }
  // Reports run from the first step to the last.
  for (auto* list : {&result.report.smallest_pivot, &result.report.largest_pivot, &result.report.residual})
    std::reverse(list->begin(), list->end());
  result.report.seconds = now() - start;
  return result;
}

}  // namespace rhytid::adjoint
