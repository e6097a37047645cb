#include "sim/time/simulate.h"

#include <chrono>
#include <cmath>
#include <cstdio>

#include "sim/core/error.h"

namespace rhytid {

void RunOptions::validate() const {
  require(frame_rate > 0 && std::isfinite(frame_rate), "RunOptions::frame_rate must be positive");
  require(frames >= 0, "RunOptions::frames must not be negative");
  require(frames_done >= 0, "RunOptions::frames_done must not be negative");
  require(substeps >= 1, "RunOptions::substeps must be at least 1");
  require(max_bisections >= 0 && max_bisections <= 20, "RunOptions::max_bisections must be in 0..20");
  minimiser.validate();
}

MinimiserReport solve_step(StepProblem& problem, const State& old, const MinimiserOptions& options,
                           CholeskyFactor& factor, BlockMatrix& matrix, VectorXd& q,
                           const IterationCallback& callback) {
  const VectorXd held = problem.model().to_unknowns(old.u);
  q = problem.first_guess();
  const bool moved = q != held;
  MinimiserReport report = minimise(problem, q, options, factor, matrix, callback);
  if (report.converged() || report.status == MinimiserStatus::interrupted || !moved) return report;
  q = held;
  return minimise(problem, q, options, factor, matrix, callback);
}

Trajectory simulate(const Model& model, const VectorXd& native, const RunOptions& options,
                    const RunObserver& observer, const State* initial) {
  options.validate();
  const auto start = std::chrono::steady_clock::now();
  Trajectory run;
  run.initial = initial ? *initial : model.rest_state();
  run.frame_end.push_back(0);
  State current = run.initial;
  BlockMatrix matrix(model.pattern());
  CholeskyFactor factor(model.pattern());
  const double frame_dt = 1 / options.frame_rate;
  const double t0 = options.frames_done > 0 ? 0 : run.initial.time;

  for (int frame = options.frames_done + 1; frame <= options.frames; ++frame) {
    for (int sub = 1; sub <= options.substeps; ++sub) {
      // Times from integers, so that they do not depend on how often steps were bisected.
      const double t_end = t0 + frame_dt * (frame - 1 + static_cast<double>(sub) / options.substeps);
      // A pending stack of end times: a failed step is replaced by its two halves.
      std::vector<std::pair<double, int>> pending{{t_end, 0}};
      while (!pending.empty()) {
        const auto [target, depth] = pending.back();
        const StepInfo step{static_cast<int>(run.steps.size()), current.time, target};
        StepProblem problem(model, native, step, current);
        VectorXd q;
        IterationCallback callback;
        if (observer.iteration)
          callback = [&, t = target](int it, double e, double r) {
            return observer.iteration(frame, t, it, e, r);
          };
        MinimiserReport report = solve_step(problem, current, options.minimiser, factor, matrix, q, callback);
        bool softened = false;
        if (!report.converged()) {
          if (report.status != MinimiserStatus::interrupted && depth < options.max_bisections) {
            pending.back().second = depth + 1;
            pending.emplace_back(0.5 * (current.time + target), depth + 1);
            continue;
          }
          if (report.status != MinimiserStatus::interrupted) {
            VectorXd q_softened;
            MinimiserReport last =
                solve_step_softened(problem, options.minimiser, factor, matrix, q_softened, callback);
            softened = last.converged();
            if (softened || last.status == MinimiserStatus::interrupted) {
              report = std::move(last);
              q = std::move(q_softened);
            }
          }
        }
        if (!report.converged()) {
          char text[256];
          std::snprintf(text, sizeof text,
                        "frame %d, t = %.6g s: %s after %d iterations and %d bisections (residual %.3g N, "
                        "wanted %.3g N)",
                        frame, target, name(report.status), report.iterations, depth, report.residual,
                        report.tolerance);
          run.failure = text;
          run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
          return run;
        }
        pending.pop_back();
        State next = problem.advance(model.to_displacement(q));
        StepRecord record{step, frame, depth, softened, {}, std::move(report)};
        const bool frame_done = pending.empty() && sub == options.substeps;
        if (observer.step) observer.step({problem, next, record, frame_done});
        current = std::move(next);
        if (options.keep_states) record.state = current;
        run.steps.push_back(std::move(record));
      }
    }
    run.frame_end.push_back(static_cast<int>(run.steps.size()));
  }
  run.complete = true;
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return run;
}

}  // namespace rhytid
