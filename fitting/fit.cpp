#include "fitting/fit.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include "fitting/identifiability.h"
#include "sim/core/error.h"
#include "sim/scene/names.h"
#include "sim/scene/parameter.h"

namespace rhytid::fitting {
namespace {

std::string number(const char* pattern, double x) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, x);
  return text;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

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

/// Spread of the noise against its covariances, and how it repeats from frame to frame.
struct NoiseCheck {
  double reduced_chi_square = 0, autocorrelation = 0, widening = 1;
};

NoiseCheck check_noise(FitProblem& problem, const FitEvaluation& at, const VectorXd& whitened) {
  NoiseCheck check;
  check.reduced_chi_square = whitened.squaredNorm() / std::max(1, problem.degrees_of_freedom());
  std::vector<MatrixXd> innovations;
  std::vector<std::vector<int>> frames;
  for (std::size_t i = 0; i < problem.compared().size(); ++i) {
    innovations.push_back(problem.noise()[i].innovations(at.differences[i], at.tracks[i]));
    frames.push_back(problem.compared()[i].frames);
  }
  check.autocorrelation = lag_one_autocorrelation(innovations, frames);
  check.widening = interval_widening(check.reduced_chi_square, check.autocorrelation);
  return check;
}

/// Residuals and Jacobian by track, rows numbered by frame and axis; shifts count as frame 0 and, from a
/// renewal on, as frames behind the last.
std::vector<WhitenedTrack> whitened_tracks(const FitProblem& problem, const FitProblem::Linearised& at) {
  std::vector<WhitenedTrack> tracks;
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < problem.compared().size(); ++i) {
    const FitProblem::ComparedTrack& c = problem.compared()[i];
    const Eigen::Index n = problem.noise()[i].num_rows();
    WhitenedTrack track{c.first, {}, at.jacobian.middleRows(row, n), at.residuals.segment(row, n)};
    for (const int frame : c.frames)
      for (const int axis : {0, 1}) track.rows.push_back(2 * frame + axis);
    const TrackNoise& noise = problem.noise()[i];
    for (int shift = 0; shift < noise.num_shifts(); ++shift)
      for (const int axis : {0, 1})
        track.rows.push_back(shift == 0 ? axis : 2 * (problem.frames() + shift) + axis);
    tracks.push_back(std::move(track));
    row += n;
  }
  return tracks;
}

/// Truth in the units of the held modulus: displacements only tell stiffnesses relative to it.
std::map<std::string, double> truth_in_gauge(const FitInput& input, const Parametrisation& p,
                                             FitResult& result) {
  std::map<std::string, double> truth = input.truth;
  const std::string gauge = "/skin/layers/" + p.gauge_layer() + "/youngs_modulus";
  const auto known = truth.find(gauge);
  if (known == truth.end() || p.modulus_variable(p.gauge_layer()) >= 0) return truth;
  const double factor = get_parameter(input.scene, gauge) / known->second;
  if (std::fabs(factor - 1) < 1e-12) return truth;
  for (auto& [address, value] : truth)
    if (address.ends_with("/youngs_modulus") || address.ends_with("/stiffness")) value *= factor;
  result.notes.push_back("True stiffnesses were multiplied by " + number("%.6g", factor) +
                         " for the comparison: the truth's modulus of layer " + p.gauge_layer() +
                         " is not the one held.");
  return truth;
}

void add_modulus_ratios(const FitProblem& problem, const Identifiability& found, const VectorXd& t,
                        const std::map<std::string, double>& truth, FitResult& result) {
  const Parametrisation& p = problem.parametrisation();
  const Scene scene = p.scene(t);
  const std::string base = p.gauge_layer();
  const auto modulus = [&](const std::string& layer) {
    return get_parameter(scene, "/skin/layers/" + layer + "/youngs_modulus");
  };
  const auto true_modulus = [&](const std::string& layer) {
    const auto known = truth.find("/skin/layers/" + layer + "/youngs_modulus");
    return known == truth.end() ? std::numeric_limits<double>::quiet_NaN() : known->second;
  };
  for (const LayerScene& layer : scene.skin.layers) {
    if (layer.name == base) continue;
    VectorXd g = VectorXd::Zero(problem.num_parameters());  // of ln(E_layer / E_base) by t
    const int above = p.modulus_variable(layer.name), below = p.modulus_variable(base);
    if (above < 0 && below < 0) continue;
    if (above >= 0) g[above] += p.variables()[above].derivative(t[above]) / modulus(layer.name);
    if (below >= 0) g[below] -= p.variables()[below].derivative(t[below]) / modulus(base);
    const double half = found.half_width(g);
    DerivedQuantity ratio{.name = "Young's modulus " + layer.name + " / " + base,
                          .unit = "",
                          .value = modulus(layer.name) / modulus(base),
                          .truth = {}};
    ratio.low95 = ratio.value * std::exp(-half);
    ratio.high95 = ratio.value * std::exp(half);
    const double true_ratio = true_modulus(layer.name) / true_modulus(base);
    if (std::isfinite(true_ratio)) ratio.truth = true_ratio;
    result.derived.push_back(std::move(ratio));
  }
}

void add_parameters(const FitProblem& problem, const VectorXd& t, const Identifiability* found,
                    const std::map<std::string, double>& truth, FitResult& result) {
  const Parametrisation& p = problem.parametrisation();
  for (int k = 0; k < p.size(); ++k) {
    const FitVariable& v = p.variables()[k];
    FittedParameter f{.address = v.address,
                      .name = v.name,
                      .unit = v.unit,
                      .transform = to_string(v.transform),
                      .initial = v.initial,
                      .value = std::clamp(v.to_parameter(t[k]), v.lower, v.upper),
                      .lower = v.lower,
                      .upper = v.upper,
                      .truth = {}};
    const double range = p.upper()[k] - p.lower()[k];
    f.at_bound = std::min(t[k] - p.lower()[k], p.upper()[k] - t[k]) < 1e-6 * range;
    f.sigma = found != nullptr ? found->sigma(k) : std::numeric_limits<double>::infinity();
    f.determined = found != nullptr && found->determined(k);
    const double half = found != nullptr ? found->half_width(k) : f.sigma;
    f.low95 = std::isfinite(half) ? std::max(v.lower, v.to_parameter(t[k] - half)) : v.lower;
    f.high95 = std::isfinite(half) ? std::min(v.upper, v.to_parameter(t[k] + half)) : v.upper;
    if (!std::isfinite(f.sigma)) f.sigma = std::numeric_limits<double>::quiet_NaN();
    if (f.at_bound)
      result.cannot_tell.push_back(v.name + " ended at its bound " + number("%.4g", f.value) + " " + v.unit +
                                   ": the data ask for a value beyond it, its interval is only a hint.");
    if (const auto known = truth.find(v.address); known != truth.end()) f.truth = known->second;
    result.parameters.push_back(std::move(f));
  }
}

void add_residuals(const FitProblem& problem, const TrackSet& tracks, const FitEvaluation& at,
                   FitResult& result) {
  double sum = 0;
  for (std::size_t i = 0; i < problem.compared().size(); ++i) {
    const FitProblem::ComparedTrack& c = problem.compared()[i];
    for (std::size_t j = 0; j < c.frames.size(); ++j) {
      const Vec2 difference = at.differences[i].segment<2>(2 * j);
      const Vec2 predicted = c.observed[j] - difference;
      sum += difference.squaredNorm();
      result.residuals.push_back({.frame = c.frames[j],
                                  .track = tracks.tracks[c.track].id,
                                  .x_px = c.observed[j].x(),
                                  .y_px = c.observed[j].y(),
                                  .predicted_x_px = predicted.x(),
                                  .predicted_y_px = predicted.y(),
                                  .weight = at.tracks[i].weights[j]});
    }
  }
  result.rms_px = std::sqrt(sum / std::max<std::size_t>(1, result.residuals.size()));
}

void add_notes(const FitProblem& problem, const FitInput& input, const FitEvaluation* at, FitResult& result) {
  const RegistrationReport& r = problem.registration().report;
  if (r.left_out() > 0)
    result.notes.push_back(std::to_string(r.left_out()) + " tracks left out: " + std::to_string(r.not_seen) +
                           " not seen in frame 0 (tracks that begin later are not attached), " +
                           std::to_string(r.missed_mesh) + " beside the skin, " +
                           std::to_string(r.back_side) + " on its back, " + std::to_string(r.near_rim) +
                           " nearer than " + number("%.3g", input.options.rim_margin) + " mm to the rim, " +
                           std::to_string(r.not_refined) + " on a silhouette.");
  result.notes.push_back(
      "Each track is weighted by its own covariance in every frame; the error of its first pixel, which "
      "places "
      "its material point, is carried into all its frames. Together they count as at least " +
      number("%.3g", input.options.min_sigma) + " px per axis.");
  if (input.options.robust_scale > 0 && at != nullptr) {
    int discounted = 0;
    for (const TrackNoise::Evaluation& track : at->tracks)
      discounted += static_cast<int>(
          std::count_if(track.weights.begin(), track.weights.end(), [](double w) { return w < 1; }));
    result.notes.push_back("Huber loss beyond " + number("%.3g", input.options.robust_scale) +
                           " standard deviations; " + std::to_string(discounted) + " of " +
                           std::to_string(problem.num_observations()) + " observations were discounted.");
  }
  result.notes.push_back("Damper scheme: " + to_string(input.scene.time.damper) +
                         "; relaxation times and fractions depend on it.");
  if (problem.parametrisation().gauge_is_free())
    result.notes.push_back(
        "Warning: every stiffness is fitted and there are no force data: absolute values are arbitrary, only "
        "ratios are meaningful. Leave one Young's modulus out of the fitted parameters.");
}

/// Where the common misfit of neighbours decides the interval, and by how much.
std::string which_are_wider(const Identifiability& found, const std::vector<FitVariable>& variables) {
  std::string list;
  for (int k = 0; k < static_cast<int>(variables.size()); ++k) {
    const double ratio = found.widened_by_misfit(k);
    if (ratio > 1 + 1e-9)
      list += (list.empty() ? "" : ", ") + variables[k].name + number(" %.2f times", ratio) +
              number(" on %.3g degrees of freedom",
                     found.degrees(VectorXd::Unit(static_cast<Eigen::Index>(variables.size()), k)));
  }
  return list.empty() ? "nowhere here" : "here " + list;
}

}  // namespace

FitResult run_fit(const FitInput& input, const FitObserver& observer) {
  const auto start = std::chrono::steady_clock::now();
  FitProblem problem(input.scene, input.options, input.camera, input.tracks);
  problem.on_run = observer.run;
  problem.should_stop = observer.should_stop;
  if (observer.registered) observer.registered(problem);
  std::optional<EvaluationLog> log;
  if (!input.evaluations.empty()) {
    const auto note = [&observer](const std::string& text) {
      if (observer.note && !text.empty()) observer.note(text);
    };
    log.emplace(input.evaluations, fit_identity(input, problem), input.anew);
    log->warn = note;
    problem.log = &*log;
    note(log->set_aside());
    if (log->num_runs() > 0)
      note("resumed: " + std::to_string(log->num_runs()) + " runs of an earlier start are in " +
           input.evaluations);
  }
  if (input.options.optimiser != "ceres" && input.options.optimiser != "nlopt")
    throw InputError("fit: optimiser", "'" + input.options.optimiser + "'", "ceres or nlopt");
  const OptimiserOptions options{.max_evaluations = input.options.max_evaluations};
  const bool is_ceres = input.options.optimiser == "ceres";
  OptimiserOutcome outcome = is_ceres ? fit_with_ceres(problem, options, observer.iteration)
                                      : fit_with_nlopt(problem, options, observer.iteration);

  FitResult result;
  result.optimiser = is_ceres ? "ceres (Levenberg-Marquardt, tangent)" : "nlopt (SLSQP, adjoint)";
  result.status = status_text(outcome);
  result.converged = outcome.status == OptimiserOutcome::Status::converged;
  result.history = std::move(outcome.history);
  result.gauge = problem.parametrisation().gauge_sentence();
  result.num_observations = problem.num_observations();
  result.num_tracks = static_cast<int>(problem.compared().size());
  result.tracks_left_out = problem.registration().report.left_out();
  result.frames = problem.frames();
  if (!result.history.empty()) result.initial_cost = result.history.front().cost;

  const bool have_point = problem.best().size() > 0 && !problem.was_stopped();
  const VectorXd t = problem.best().size() > 0 ? problem.best() : problem.parametrisation().initial();
  const auto linearised = have_point ? problem.linearised(t) : std::nullopt;
  const FitEvaluation* at = have_point ? &problem.evaluate(t) : nullptr;
  if (at != nullptr && at->failed) at = nullptr;  // stopped while the best point was run again
  if (problem.was_stopped()) {
    result.converged = false;
    result.status = "failed: stopped by the user";
    result.stopped = true;
  }
  if (at != nullptr) {
    result.final_cost = at->cost;
    add_residuals(problem, input.tracks, *at, result);
  } else {
    result.final_cost = problem.best_cost();
  }
  if (at != nullptr) {
    result.fitted_scene = problem.parametrisation().scene(t);
    result.fitted_scene_file = "fitted_scene.json";
  }
  add_notes(problem, input, at, result);
  const std::map<std::string, double> truth = truth_in_gauge(input, problem.parametrisation(), result);
  if (linearised) {
    const NoiseCheck noise = check_noise(problem, *at, linearised->residuals);
    result.reduced_chi_square = noise.reduced_chi_square;
    const std::vector<FitVariable>& variables = problem.parametrisation().variables();
    const Identifiability found(linearised->jacobian, variables, noise.widening, problem.degrees_of_freedom(),
                                whitened_tracks(problem, *linearised));
    add_parameters(problem, t, &found, truth, result);
    add_modulus_ratios(problem, found, t, truth, result);
    result.singular_values = found.singular_values();
    result.right_vectors = found.right_vectors();
    result.correlation = found.correlation();
    for (std::string& sentence : found.cannot_tell()) result.cannot_tell.push_back(std::move(sentence));
    result.notes.push_back("95 % intervals: Student's t on " + std::to_string(problem.degrees_of_freedom()) +
                           " degrees of freedom, standard deviations widened by " +
                           number("%.3f", noise.widening) + " (reduced chi-square " +
                           number("%.3f", noise.reduced_chi_square) +
                           ", lag-1 autocorrelation of whitened residuals within tracks " +
                           number("%.3f", noise.autocorrelation) +
                           "), or what neighbouring tracks err alike where that is more (" +
                           which_are_wider(found, variables) + ").");
  } else {
    add_parameters(problem, t, nullptr, truth, result);
    result.notes.push_back("No intervals: the run at the last values could not be differentiated.");
  }
  result.forward_runs = problem.counters().forward_runs;
  result.jacobian_runs = problem.counters().tangent_sweeps + problem.counters().adjoint_sweeps;
  result.forward_seconds = median(problem.counters().forward_seconds);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace rhytid::fitting
