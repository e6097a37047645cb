#include "fitting/fit.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "fitting/consider.h"
#include "fitting/considered_quantities.h"
#include "fitting/discretisation.h"
#include "fitting/error_posterior.h"
#include "fitting/fit_logs.h"
#include "fitting/fit_summary.h"
#include "fitting/further_views.h"
#include "fitting/median.h"
#include "fitting/path_deviations.h"
#include "fitting/profile.h"
#include "fitting/residual_signature.h"
#include "fitting/stages.h"
#include "fitting/starts.h"
#include "fitting/wave_lead.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// A stage only says where to begin: a step that lowers F by less is not worth its run.
constexpr double kStageDecrease = 1e-2;

std::string status_text(const OptimiserOutcome& outcome) {
  using Status = OptimiserOutcome::Status;
  switch (outcome.status) {
    case Status::converged:
      return "converged";
    case Status::max_evaluations:
      return "max_evaluations";
    case Status::stopped:
      return "failed: stopped by the user";
    case Status::failed:
      break;
  }
  return "failed: " + outcome.detail;
}

OptimiserOutcome minimise(const FitCase& fit, Search& search, const OptimiserOptions& options,
                          const FitIterationCallback& callback) {
  return fit.optimiser == "ceres" ? fit_with_ceres(search, options, callback)
                                  : fit_with_nlopt(search, options, callback);
}

/// With the budget of the case; `fit` and `observer` must outlive it.
LocalFit local_search(const FitCase& fit, OptimiserOptions options, const FitObserver& observer) {
  options.max_evaluations = fit.max_evaluations;
  return [&fit, options, &observer](Search& search) {
    return minimise(fit, search, options, observer.iteration);
  };
}

/// Where the best point was found: its fit, with intervals where there is a derivative. `lead` may be null.
void describe_best(const JointFitInput& input, JointProblem& problem, WaveLead* lead,
                   const StartsOutcome& starts, bool have_point, const FitObserver& observer,
                   FitResult& result) {
  const VectorXd& t = starts.best().t.size() > 0 ? starts.best().t : starts.starts[0].t;
  const auto linearised = have_point ? problem.linearised(t) : std::nullopt;
  const bool is_there = have_point && !problem.evaluate(t).failed;  // else stopped while it was run again
  const auto stop_here = [&result] {
    result.converged = false;
    result.status = "failed: stopped by the user";
    result.stopped = true;
  };
  if (problem.was_stopped()) stop_here();
  if (is_there) {
    result.final_cost = problem.evaluate(t).cost;
    add_residuals(input, problem, t, result);
    if (lead != nullptr) add_waves(lead->problem(), problem, t, result);
    for (int c = 0; c < problem.num_clips(); ++c)
      result.fitted_scenes.push_back(problem.clip(c).parametrisation().scene(problem.of_clip(c, t)));
    result.fitted_scene = result.fitted_scenes.front();
    result.fitted_scene_file = "fitted_scene.json";
    for (FittedClip& clip : result.clips)
      clip.fitted_scene_file =
          problem.num_clips() == 1 ? "fitted_scene.json" : clip.name + "/fitted_scene.json";
  }
  add_notes(input, problem, t, is_there, result);
  const std::map<std::string, double> truth = truth_in_gauge(input, problem, result);
  if (!linearised) {
    add_parameters(problem, t, nullptr, truth, result);
    add_starts(problem, starts, input.options, 1, result);
    result.notes.push_back("No intervals: the run at the last values could not be differentiated.");
    return;
  }
  const NoiseCheck noise = check_noise(problem, t, linearised->residuals);
  result.reduced_chi_square = noise.reduced_chi_square;
  Identifiability found(linearised->jacobian, problem.variables(), noise.widening,
                        problem.degrees_of_freedom(), whitened_tracks(problem, *linearised));
  if (input.options.discretisation_check) {
    result.systematic = discretisation_shifts(input, problem, t, *linearised, found.basis(), observer);
    if (result.systematic.empty()) stop_here();
  }
  if (!considered_parameters(input).empty()) {
    const std::vector<SystematicShift> held =
        considered_shifts(input, problem, t, *linearised, found.basis(), observer);
    if (held.empty()) stop_here();
    result.systematic.insert(result.systematic.end(), held.begin(), held.end());
  }
  if (!considered_quantities(input).empty() && !problem.was_stopped()) {
    const std::vector<SystematicShift> moved =
        quantity_shifts(input, problem, t, *linearised, found.basis(), observer);
    if (moved.empty()) stop_here();
    result.systematic.insert(result.systematic.end(), moved.begin(), moved.end());
  }
  add_path_notes(input, result);
  weigh_by_residuals(*linearised, found.basis(), problem.degrees_of_freedom(), noise.autocorrelation,
                     result.systematic);
  for (const SystematicShift* shift : counted_shifts(result.systematic)) {
    if (shift->axes.empty()) found.add_systematic(shift->shift);
    for (const std::vector<double>& axis : shift->axes) found.add_systematic(axis);
  }
  add_parameters(problem, t, &found, truth, result);
  if (lead != nullptr) lead->add_note(t, found, result);
  add_modulus_ratios(problem, found, t, truth, result);
  add_clip_chi_squares(problem, *linearised, found, result);
  add_systematic_notes(input.options, result);
  result.misfit = misfit_sentences(result, problem.degrees_of_freedom(), noise.autocorrelation);
  result.singular_values = found.singular_values();
  result.right_vectors = found.right_vectors();
  result.correlation = found.correlation();
  for (std::string& sentence : found.cannot_tell()) result.cannot_tell.push_back(std::move(sentence));
  add_starts(problem, starts, input.options, noise.widening, result);
  result.notes.push_back(interval_note(problem, noise, found));
  result.further_views = further_views(problem, t, *linearised);  // before others: it may need a run again
  if (!result.stopped) {
    // What is left undone of a refit then shifts its 2ΔF/w² by less than 0.01.
    const double enough = 5e-3 * noise.widening * noise.widening / result.final_cost;
    const LocalFit refit =
        local_search(input.options, {.relative_decrease = std::clamp(enough, 1e-6, 1e-3)}, observer);
    add_profiles(problem, t, profiled_variables(problem, input.options.profiles), found, noise.widening,
                 refit, observer, result);
  }
  if (problem.was_stopped()) stop_here();
}

/// What the clips' problems have counted.
void add_counts(const JointProblem& problem, FitResult& result) {
  std::vector<double> seconds;
  for (int c = 0; c < problem.num_clips(); ++c) {
    const FitProblem& clip = problem.clip(c);
    result.num_tracks += static_cast<int>(clip.compared().size());
    result.tracks_left_out += clip.registration().report.left_out();
    result.frames += clip.frames();
    result.jacobian_runs += clip.counters().tangent_sweeps + clip.counters().adjoint_sweeps;
    seconds.insert(seconds.end(), clip.counters().forward_seconds.begin(),
                   clip.counters().forward_seconds.end());
  }
  result.num_observations = problem.num_observations();
  result.forward_runs = problem.forward_runs();
  result.forward_seconds = median(seconds);
}

}  // namespace

FitResult run_fit(const FitInput& input, const FitObserver& observer) {
  std::vector<std::vector<Scene>> stages;
  for (const Scene& scene : input.stages) stages.push_back({scene});
  return run_fit(JointFitInput{.clips = {{{}, {}, input.scene, {input.camera}, input.tracks}},
                               .options = input.options,
                               .stages = std::move(stages),
                               .truth = input.truth,
                               .evaluations = input.evaluations,
                               .anew = input.anew},
                 observer);
}

FitResult run_fit(const JointFitInput& given, const FitObserver& observer) {
  const auto start = std::chrono::steady_clock::now();
  const JointFitInput led = with_path_errors(given);
  JointFitInput input = led;  // what is answered is by the points
  input.options.waves.reset();
  JointProblem problem(input.clips, input.options);
  problem.on_run = observer.run;
  problem.stop_when(observer.should_stop);
  for (int c = 0; c < problem.num_clips() && observer.registered; ++c) observer.registered(problem.clip(c));
  const auto note = [&observer](const std::string& text) {
    if (observer.note && !text.empty()) observer.note(text);
  };
  const FitLogs logs(input, problem, note);
  if (input.options.optimiser != "ceres" && input.options.optimiser != "nlopt")
    throw InputError("fit: optimiser", "'" + input.options.optimiser + "'", "ceres or nlopt");
  profiled_variables(problem, input.options.profiles);  // throws before anything is run
  std::optional<WaveLead> lead;
  if (led.options.waves) lead.emplace(led, observer);
  LocalFit local_fit = local_search(input.options, {}, observer);
  if (lead) local_fit = lead->both_ways(problem, local_fit);
  StagesOutcome stages = run_stages(
      led, problem,
      [&](Search& search, int most) {
        return minimise(input.options, search, {.max_evaluations = most, .relative_decrease = kStageDecrease},
                        {});
      },
      observer);
  StartsOutcome starts = fit_from_starts(led, problem, better_start(lead ? lead->problem() : problem, stages),
                                         local_fit, observer);
  if (lead) lead->add_runs(starts);
  const OptimiserOutcome& outcome = starts.best();

  FitResult result;
  result.optimiser =
      input.options.optimiser == "ceres" ? "ceres (Levenberg-Marquardt, tangent)" : "nlopt (SLSQP, adjoint)";
  result.status = status_text(outcome);
  result.converged = outcome.status == OptimiserOutcome::Status::converged;
  result.stopped = outcome.status == OptimiserOutcome::Status::stopped;
  result.history = outcome.history;
  result.stages = stages.stages;
  if (lead) lead->add_stage(outcome.t, result);
  result.gauge = problem.gauge_sentence();
  if (!result.history.empty()) result.initial_cost = result.history.front().cost;
  const bool has_best = outcome.t.size() > 0 && std::isfinite(outcome.cost);
  if (has_best) result.final_cost = outcome.cost;
  describe_best(input, problem, lead ? &*lead : nullptr, starts, has_best && !result.stopped, observer,
                result);
  add_counts(problem, result);
  result.forward_runs += starts.screening_runs;
  if (lead) result.forward_runs += lead->problem().forward_runs();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace rhytid::fitting
