#include "adjoint/resimulate.h"

#include <chrono>

#include "sim/time/step_passes.h"

namespace rhytid::adjoint {

Trajectory resimulate(const Model& model, const VectorXd& native, const Trajectory& reference,
                      const MinimiserOptions& options, const StartGuess& guess,
                      const ResimulationObserver& observer, bool keep_history) {
  const auto start = std::chrono::steady_clock::now();
  Trajectory run;
  run.initial = reference.initial;
  State current = run.initial;
  if (!reference.steps.empty()) current.time = reference.steps.front().step.t_old;
  const auto passes = [&](const StepRecord& known) {
    return 1 + static_cast<int>(known.earlier_passes.size());
  };
  StepSolver solver(model, native, options, reference.steps.empty() ? 1 : passes(reference.steps.front()));
  for (int i = 0; i < static_cast<int>(reference.steps.size()); ++i) {
    const StepRecord& known = reference.steps[i];
    MinimiserReport report;
    if (guess) {
      const VectorXd from = guess(i, current);
      report = solver.solve(known.step, current, &from);
    }
    if (!report.converged()) report = solver.solve(known.step, current);
    if (!report.converged() && known.softened) report = solver.solve_softened(known.step, current);
    if (!report.converged()) {
      run.failure = "step " + std::to_string(i) + ": " + name(report.status) + " after " +
                    std::to_string(report.iterations) + " iterations";
      break;
    }
    State next = solver.problem().advance(solver.displacement());
    if (observer && !observer(i, solver.problem(), next)) {
      run.failure = "stopped";
      break;
    }
    StepRecord record{known.step, known.frame, known.bisections, known.softened, next, std::move(report)};
    record.earlier_passes = solver.earlier_passes();
    if (!keep_history) record.state.history.resize(0);
    current = std::move(next);
    run.steps.push_back(std::move(record));
  }
  run.complete = run.steps.size() == reference.steps.size() && reference.complete;
  for (const int end : reference.frame_end)
    if (end <= static_cast<int>(run.steps.size())) run.frame_end.push_back(end);
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return run;
}

std::vector<signed char> step_regimes(const StepProblem& problem, const VectorXd& u) {
  std::vector<signed char> all;
  const std::vector<Term>& terms = problem.model().terms;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    const std::vector<signed char> own = terms[t].regimes(problem.step(), problem.data(t), u);
    all.insert(all.end(), own.begin(), own.end());
  }
  return all;
}

}  // namespace rhytid::adjoint
