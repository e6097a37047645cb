#include "fitting/stages.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "fitting/fit_logs.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// The fit of a stage, as a fit of its own without starts, stages and checks.
JointFitInput stage_input(const JointFitInput& input, const JointProblem& problem, std::size_t s) {
  JointFitInput stage = input;
  // What the case leaves open comes from the fit's scenes, not from the stage's.
  for (std::size_t k = 0; k < stage.options.parameters.size(); ++k) {
    FitParameter& p = stage.options.parameters[k];
    const FitVariable& v = problem.variables()[k];
    p.initial = v.initial, p.lower = v.lower, p.upper = v.upper, p.transform = v.transform;
  }
  stage.stages.clear();
  for (std::size_t c = 0; c < stage.clips.size(); ++c) stage.clips[c].scene = input.stages[s][c];
  const StageCase& given = input.options.stages[s];
  if (given.last_frame > 0) {
    stage.options.last_frame = given.last_frame;
    for (FitClip& clip : stage.clips)
      std::erase_if(clip.measured, [&](const Measurement& m) { return m.frame > given.last_frame; });
  }
  if (!stage.evaluations.empty()) stage.evaluations += "/stage_" + std::to_string(s + 1);
  return stage;
}

/// Name of a parameter that is at its bound; empty when none is. From there a fit hardly returns: a strength
/// that has gone to nothing has no derivative.
std::string at_bound(const JointProblem& problem, const VectorXd& t) {
  const VectorXd lower = problem.lower(), upper = problem.upper();
  for (int k = 0; k < problem.num_parameters(); ++k)
    if (std::min(t[k] - lower[k], upper[k] - t[k]) < 1e-6 * (upper[k] - lower[k]))
      return problem.variables()[static_cast<std::size_t>(k)].name;
  return {};
}

}  // namespace

StagesOutcome run_stages(const JointFitInput& input, const JointProblem& problem, const StageFit& local_fit,
                         const FitObserver& observer) {
  require(input.stages.size() == input.options.stages.size(), "run_stages: scenes for every stage");
  StagesOutcome found;
  found.start = problem.initial();
  for (std::size_t s = 0; s < input.stages.size(); ++s) {
    const std::string name = "stage " + std::to_string(s + 1);
    const auto begin = std::chrono::steady_clock::now();
    const JointFitInput own = stage_input(input, problem, s);
    FittedStage& stage = found.stages.emplace_back();
    stage.change = input.options.stages[s].words();
    if (observer.note) observer.note(name + ": " + stage.change);
    try {
      JointProblem coarse(own.clips, own.options);
      coarse.stop_when(observer.should_stop);
      coarse.on_run = [&](const FitProgress& run) {
        if (observer.run) observer.run(run);
      };
      const FitLogs logs(own, coarse, observer.note);
      Search search(coarse, found.start);
      const OptimiserOutcome outcome = local_fit(search, input.options.stages[s].max_evaluations);
      stage.forward_runs = coarse.forward_runs();
      found.was_stopped = coarse.was_stopped();
      if (search.best().size() > 0) {
        const VectorXd end = search.all(search.best());
        const std::string stuck = at_bound(coarse, end);
        stage.cost = search.best_cost();
        using Status = OptimiserOutcome::Status;
        stage.status = outcome.status == Status::converged         ? "converged"
                       : outcome.status == Status::max_evaluations ? "max_evaluations"
                                                                   : "ended early: " + outcome.detail;
        if (stuck.empty())
          found.start = end;
        else
          stage.status += "; not followed, since " + stuck + " ended at a bound";
      } else {
        stage.status = "failed: " + coarse.last_failure();
      }
    } catch (const InputError& error) {
      throw InputError("fit: " + name + ": " + error.what());
    }
    const VectorXd values = problem.values(found.start);
    stage.values.assign(values.begin(), values.end());
    stage.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (found.was_stopped) break;
  }
  return found;
}

VectorXd better_start(JointProblem& problem, StagesOutcome& found) {
  if (found.stages.empty() || found.was_stopped) return found.start;
  const VectorXd initial = problem.initial();
  const ObjectiveEvaluation before = problem.evaluate(initial);
  const ObjectiveEvaluation& after = problem.evaluate(found.start);
  if (problem.was_stopped() || before.failed || (!after.failed && after.cost <= before.cost))
    return found.start;
  found.stages.back().status +=
      after.failed ? "; the fit begins at the initial values, since its run there failed: " + after.failure
                   : "; the fit begins at the initial values, which cost less";
  return initial;
}

}  // namespace rhytid::fitting
