#include "sim/time/simulate.h"

#include <chrono>
#include <cmath>
#include <cstdio>

#include "sim/core/error.h"
#include "sim/time/step_passes.h"

namespace rhytid {

void RunOptions::validate() const {
  require(frame_rate > 0 && std::isfinite(frame_rate), "RunOptions::frame_rate must be positive");
  require(frames >= 0, "RunOptions::frames must not be negative");
  require(frames_done >= 0, "RunOptions::frames_done must not be negative");
  require(substeps >= 1, "RunOptions::substeps must be at least 1");
  require(lag_passes >= 1 && lag_passes <= 100, "RunOptions::lag_passes must be in 1..100");
  require(max_bisections >= 0 && max_bisections <= 20, "RunOptions::max_bisections must be in 0..20");
  minimiser.validate();
}

namespace {

/// Of the vectors [nodes·3].
double largest_length(const VectorXd& vectors) {
  return std::sqrt(
      Eigen::Map<const MatrixX3>(vectors.data(), vectors.size() / 3, 3).rowwise().squaredNorm().maxCoeff());
}

/// The steps of a run one after the other.
class Runner {
 public:
  Runner(const Model& model, const VectorXd& native, const RunOptions& options, const RunObserver& observer,
         const State* initial)
      : options_(options),
        observer_(observer),
        start_(std::chrono::steady_clock::now()),
        solver_(model, native, options.minimiser, options.lag_passes) {
    run_.initial = initial ? *initial : model.rest_state();
    current_ = run_.initial;
  }

  Trajectory go() {
    const double t0 = options_.frames_done > 0 ? 0 : run_.initial.time;
    if (options_.settle && options_.frames_done == 0) {
      current_.time = t0 - kSettlingTime;
      // Halving the time would not halve the tension: no bisection.
      if (!advance(0, t0, options_.max_bisections, true)) return finish(false);
    }
    run_.frame_end.push_back(static_cast<int>(run_.steps.size()));
    const double frame_dt = 1 / options_.frame_rate;
    for (int frame = options_.frames_done + 1; frame <= options_.frames; ++frame) {
      for (int sub = 1; sub <= options_.substeps; ++sub) {
        // Times from integers, so that they do not depend on how often steps were bisected.
        const double t_end = t0 + frame_dt * (frame - 1 + static_cast<double>(sub) / options_.substeps);
        if (!advance(frame, t_end, 0, sub == options_.substeps)) return finish(false);
      }
      run_.frame_end.push_back(static_cast<int>(run_.steps.size()));
    }
    return finish(true);
  }

 private:
  Trajectory finish(bool complete) {
    run_.complete = complete;
    run_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    return std::move(run_);
  }

  /// Steps from the current time to t_end, bisected where needed. `depth`: halvings already used up.
  bool advance(int frame, double t_end, int depth_used, bool ends_frame) {
    // A pending stack of end times: a failed step is replaced by its two halves.
    std::vector<std::pair<double, int>> pending{{t_end, depth_used}};
    MinimiserReport given_up;  // work of the steps that were halved
    while (!pending.empty()) {
      const auto [target, depth] = pending.back();
      const StepInfo step{static_cast<int>(run_.steps.size()), current_.time, target};
      IterationCallback callback;
      if (observer_.iteration)
        callback = [&, t = target](int it, double e, double r) {
          return observer_.iteration(frame, t, it, e, r);
        };
      MinimiserReport report = solver_.solve(step, current_, nullptr, callback);
      bool softened = false;
      if (!report.converged()) {
        if (report.status != MinimiserStatus::interrupted && depth < options_.max_bisections) {
          given_up.add_work(report);
          pending.back().second = depth + 1;
          pending.emplace_back(0.5 * (current_.time + target), depth + 1);
          continue;
        }
        if (report.status != MinimiserStatus::interrupted) {
          MinimiserReport last = solver_.solve_softened(step, current_, callback);
          softened = last.converged();
          last.add_work(report);
          if (softened || last.status == MinimiserStatus::interrupted) report = std::move(last);
        }
      }
      if (!report.converged()) {
        char text[256];
        std::snprintf(text, sizeof text,
                      "frame %d, t = %.6g s: %s after %d iterations and %d bisections (residual %.3g N, "
                      "wanted %.3g N)",
                      frame, target, name(report.status), report.iterations, depth - depth_used,
                      report.residual, report.tolerance);
        run_.failure = text;
        return false;
      }
      pending.pop_back();
      report.add_work(given_up);
      given_up = {};
      State next = solver_.problem().advance(solver_.displacement());
      StepRecord record{step, frame, depth - depth_used, softened, {}, std::move(report)};
      if (!solver_.earlier_passes().empty())
        record.pass_change = largest_length(solver_.displacement() - solver_.earlier_passes().back());
      if (options_.account_energies) record.energies = account_step(solver_.problem(), next);
      const bool frame_done = pending.empty() && ends_frame;
      if (observer_.step) observer_.step({solver_.problem(), next, record, frame_done});
      current_ = std::move(next);
      if (options_.keep_states) {
        if (options_.keep_histories)
          record.state = current_;
        else
          record.state = {current_.time, current_.u, {}, {}};
        record.earlier_passes = solver_.earlier_passes();
      }
      run_.steps.push_back(std::move(record));
    }
    return true;
  }

  const RunOptions& options_;
  const RunObserver& observer_;
  std::chrono::steady_clock::time_point start_;
  StepSolver solver_;
  Trajectory run_;
  State current_;
};

}  // namespace

Trajectory simulate(const Model& model, const VectorXd& native, const RunOptions& options,
                    const RunObserver& observer, const State* initial) {
  options.validate();
  return Runner(model, native, options, observer, initial).go();
}

}  // namespace rhytid
