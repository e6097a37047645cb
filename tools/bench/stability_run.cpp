#include "tools/bench/stability_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <regex>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tools/scene_review.h"

namespace rhytid::tools {
namespace {

std::vector<std::string> all_warnings(const SceneModel& scene_model) {
  std::vector<std::string> warnings = scene_warnings(scene_model.scene());
  for (std::string& more : review_scene(scene_model, measure_step_cost(scene_model)))
    warnings.push_back(std::move(more));
  return warnings;
}

/// What `check` warns of, but for warnings that begin as one of the base scene does (numbers differ).
std::string warnings_of(const SceneModel& scene_model) {
  static const std::vector<std::string> usual =
      all_warnings(SceneModel(parse_scene_text(stability_scene(), "base.json")));
  std::string text;
  for (const std::string& warning : all_warnings(scene_model)) {
    const auto alike = [&](const std::string& other) { return other.compare(0, 24, warning, 0, 24) == 0; };
    if (std::none_of(usual.begin(), usual.end(), alike)) text += (text.empty() ? "" : "; ") + warning;
  }
  return text;
}

using Clock = std::chrono::steady_clock;

/// What is wrong with a state, or "".
std::string contradiction(const StepEvent& event, StabilityResult& result) {
  const State& state = event.state;
  if (!state.u.allFinite()) return "a displacement that is not finite";
  if (!state.history.allFinite()) return "a history that is not finite";
  double jacobian = std::numeric_limits<double>::infinity();
  for (const Term& term : event.problem.model().terms)
    jacobian = std::min(jacobian, term.smallest_jacobian(state.u));
  result.smallest_jacobian = std::min(result.smallest_jacobian, jacobian);
  if (!(jacobian > 0)) return "J <= 0 in an accepted state";
  const Model& model = event.problem.model();
  VectorXd residual = model.to_unknowns(event.problem.residual(state.u));
  const MinimiserReport& report = event.record.report;
  if (!(residual.norm() <= 2 * report.tolerance))
    return "a residual of " + std::to_string(residual.norm()) + " N in a step that is called converged";
  return "";
}

void run(const StabilityCase& one, double limit, const std::function<bool()>& interrupted,
         Clock::time_point start, StabilityResult& result) {
  const SceneModel scene_model(parse_scene_text(stability_scene(), "base.json", one.settings));
  RunOptions options = scene_model.run_options();
  options.keep_states = false;
  bool timed_out = false;
  std::string wrong;
  RunObserver observer;
  observer.iteration = [&](int, double, int iteration, double, double residual) {
    result.iterations += iteration > 0;
    if (!std::isfinite(residual)) wrong = "an accepted iterate whose residual is not finite";
    timed_out = std::chrono::duration<double>(Clock::now() - start).count() > limit;
    return wrong.empty() && !timed_out && !(interrupted && interrupted());
  };
  observer.step = [&](const StepEvent& event) {
    ++result.steps;
    result.bisections = std::max(result.bisections, event.record.bisections);
    result.softened += event.record.softened;
    result.largest_displacement = std::max(result.largest_displacement, event.state.u.cwiseAbs().maxCoeff());
    const MinimiserReport& report = event.record.report;
    result.residual = std::max(result.residual, report.residual / report.tolerance);
    if (wrong.empty()) wrong = contradiction(event, result);
  };
  const Trajectory trajectory = simulate(scene_model.model(), scene_model.native(), options, observer);
  result.frames = trajectory.frames();
  result.message = wrong.empty() ? trajectory.failure : wrong;
  if (!wrong.empty() || (!trajectory.complete && trajectory.failure.empty())) return;  // broken
  result.outcome = trajectory.complete ? StabilityOutcome::converged
                   : timed_out         ? StabilityOutcome::time_limit
                                       : StabilityOutcome::not_converged;
}

}  // namespace

const char* name(StabilityOutcome outcome) {
  switch (outcome) {
    case StabilityOutcome::converged:
      return "converged";
    case StabilityOutcome::refused:
      return "refused";
    case StabilityOutcome::not_converged:
      return "not converged";
    case StabilityOutcome::time_limit:
      return "time limit";
    case StabilityOutcome::broken:
      return "BROKEN";
  }
  return "BROKEN";
}

bool is_clear(const StabilityCase& one, StabilityOutcome outcome, const std::string& message) {
  static const std::regex refusal(R"((?:.* )?(/[A-Za-z0-9_/]+): got .+, expected .+)"),
      report(
          "frame \\d+, t = [-+.e\\d]+ s: [a-z_]+ after \\d+ iterations and \\d+ bisections "
          "\\(residual [-+.e\\d]+ N, wanted [-+.e\\d]+ N\\)");
  if (outcome == StabilityOutcome::converged) return true;
  if (outcome == StabilityOutcome::not_converged) return std::regex_match(message, report);
  std::smatch match;
  if (outcome != StabilityOutcome::refused || !std::regex_match(message, match, refusal)) return false;
  // The key, or one above or below it.
  const std::string named = match[1].str();
  return std::any_of(one.settings.begin(), one.settings.end(), [&](const std::string& setting) {
    const std::string key = setting.substr(0, setting.find('='));
    return named.starts_with(key) || key.starts_with(named);
  });
}

std::string stability_warnings(const StabilityCase& one) {
  return warnings_of(SceneModel(parse_scene_text(stability_scene(), "base.json", one.settings)));
}

StabilityResult run_stability_case(const StabilityCase& one, double limit,
                                   const std::function<bool()>& interrupted) {
  StabilityResult result;
  const Clock::time_point start = Clock::now();
  try {
    run(one, limit, interrupted, start, result);
  } catch (const InputError& error) {
    result.outcome = StabilityOutcome::refused;
    result.message = error.what();
  } catch (const std::exception& error) {
    result.outcome = StabilityOutcome::broken;
    result.message = error.what();
  }
  result.seconds = std::chrono::duration<double>(Clock::now() - start).count();
  using enum StabilityOutcome;
  const bool clear = is_clear(one, result.outcome, result.message);
  switch (one.demand) {
    case StabilityDemand::converges:
      result.as_demanded = result.outcome == converged;
      break;
    case StabilityDemand::refused:
      result.as_demanded = result.outcome == refused && clear;
      break;
    case StabilityDemand::clear_outcome:
      result.as_demanded = clear;  // neither broken nor at the time limit
  }
  return result;
}

}  // namespace rhytid::tools
