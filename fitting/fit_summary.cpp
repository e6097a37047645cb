#include "fitting/fit_summary.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "sim/scene/names.h"
#include "sim/scene/parameter.h"

namespace rhytid::fitting {
namespace {

std::string number(const char* pattern, double x) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, x);
  return text;
}

/// Of one clip with one camera a result says nothing by clips.
bool is_plain(const JointProblem& problem) {
  return problem.num_clips() == 1 && problem.clip(0).cameras().size() == 1;
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

void note_tracks_left_out(const FitProblem& clip, const FitCase& options, FitResult& result) {
  const RegistrationReport& r = clip.registration().report;
  if (r.left_out() == 0) return;
  const std::string where = clip.name.empty() ? "" : "Clip " + clip.name + ": ";
  result.notes.push_back(
      where + std::to_string(r.left_out()) + " tracks left out: " + std::to_string(r.not_seen) +
      " not seen in frame 0 (tracks that begin later are not attached), " + std::to_string(r.missed_mesh) +
      " beside the skin, " + std::to_string(r.back_side) + " on its back, " + std::to_string(r.near_rim) +
      " nearer than " + number("%.3g", options.rim_margin) + " mm to the rim, " +
      std::to_string(r.not_refined) + " on a silhouette.");
}

void note_head_motion(const FitProblem& clip, FitResult& result) {
  const std::string where = clip.name.empty() ? "" : "Clip " + clip.name + ": ";
  for (std::size_t c = 0; c < clip.head_motion().size(); ++c) {
    const HeadMotion& m = clip.head_motion()[c];
    const auto lost = std::count(m.known.begin(), m.known.end(), false);
    const std::string camera = clip.cameras().size() > 1 ? " before camera " + clip.cameras()[c].name : "";
    result.notes.push_back(
        where + "The head turns by up to " + number("%.2g", m.largest_turn * 57.29577951308232) +
        " degrees and moves by up to " + number("%.2g", m.largest_shift) + " mm" + camera + ", by " +
        std::to_string(m.num_tracks) + " tracks that stand still on it (" + number("%.3g", m.rms_px) +
        " px rms left, reduced chi-square " + number("%.3g", m.reduced_chi_square) + ")" +
        (lost > 0 ? "; " + std::to_string(lost) + " frames show too few of them and are not compared."
                  : "."));
    if (m.reduced_chi_square > 4)
      result.notes.push_back("Warning: " + where + "points of /fit/still do not stand still on the head" +
                             camera + ": they are off by " + number("%.2g", std::sqrt(m.reduced_chi_square)) +
                             " times their deviation.");
  }
}

void note_weights(const JointFitInput& input, FitResult& result) {
  std::string list;
  const auto add = [&list](const std::string& text) { list += (list.empty() ? "" : ", ") + text; };
  for (const FrameWeight& rule : input.options.frame_weights)
    add("frames " + std::to_string(rule.from) +
        (rule.to > 0 ? " to " + std::to_string(rule.to) : std::string(" on")) +
        number(" weigh %.3g", rule.weight) +
        (rule.half_every > 0 ? number(", half of it every %.3g frames", rule.half_every) : std::string()));
  for (const FitClip& clip : input.clips)
    if (clip.weight != 1) add("clip " + clip.name + number(" weighs %.3g", clip.weight));
  if (!list.empty())
    result.notes.push_back("Weights: " + list +
                           ". Intervals are those of observations whose variances are as many times larger.");
}

/// Residuals of one clip, its squares summed into `clip`.
void add_clip(const TrackSet& tracks, const FitProblem& problem, const FitEvaluation& at, int number,
              FittedClip& clip, FitResult& result) {
  clip.name = problem.name;
  clip.num_tracks = static_cast<int>(problem.compared().size());
  clip.tracks_left_out = problem.registration().report.left_out();
  clip.num_observations = problem.num_observations();
  clip.frames = problem.frames();
  clip.cost = at.cost;
  for (const Camera& camera : problem.cameras()) clip.views.emplace_back().camera = camera.name;
  for (std::size_t i = 0; i < problem.compared().size(); ++i) {
    const FitProblem::ComparedTrack& c = problem.compared()[i];
    FittedView& view = clip.views[c.camera];
    ++view.num_tracks;
    for (std::size_t j = 0; j < c.frames.size(); ++j) {
      const Vec2 difference = at.differences[i].segment<2>(2 * j);
      const Vec2 predicted = c.observed[j] - difference;
      view.rms_px += difference.squaredNorm();
      ++view.num_observations;
      result.residuals.push_back({.frame = c.frames[j],
                                  .track = tracks.tracks[c.track].id,
                                  .x_px = c.observed[j].x(),
                                  .y_px = c.observed[j].y(),
                                  .predicted_x_px = predicted.x(),
                                  .predicted_y_px = predicted.y(),
                                  .weight = at.tracks[i].weights[j],
                                  .clip = number,
                                  .view = c.camera});
    }
  }
  for (FittedView& view : clip.views) {
    clip.rms_px += view.rms_px;
    view.rms_px = std::sqrt(view.rms_px / std::max(1, view.num_observations));
  }
  clip.rms_px = std::sqrt(clip.rms_px / std::max(1, clip.num_observations));
}

}  // namespace

NoiseCheck check_noise(JointProblem& problem, const VectorXd& t, const VectorXd& whitened) {
  NoiseCheck check;
  check.reduced_chi_square = whitened.squaredNorm() / std::max(1, problem.degrees_of_freedom());
  std::vector<MatrixXd> innovations;
  std::vector<std::vector<int>> frames;
  for (int c = 0; c < problem.num_clips(); ++c) {
    FitProblem& clip = problem.clip(c);
    const FitEvaluation& at = clip.evaluate(problem.of_clip(c, t));
    for (std::size_t i = 0; i < clip.compared().size(); ++i) {
      innovations.push_back(clip.noise()[i].innovations(at.differences[i], at.tracks[i]));
      frames.push_back(clip.compared()[i].frames);
    }
  }
  check.autocorrelation = lag_one_autocorrelation(innovations, frames);
  check.widening = interval_widening(check.reduced_chi_square, check.autocorrelation);
  return check;
}

std::vector<WhitenedTrack> whitened_tracks(const JointProblem& problem, const FitProblem::Linearised& at) {
  std::vector<WhitenedTrack> tracks;
  Eigen::Index first_row = 0;
  for (int c = 0; c < problem.num_clips(); ++c) {
    const FitProblem& clip = problem.clip(c);
    const std::vector<Vec3> points = clip.rest_points();
    int shifts = 0;
    for (const TrackNoise& noise : clip.noise()) shifts = std::max(shifts, noise.num_shifts());
    const int per_camera = 2 * (clip.frames() + shifts + 1);
    Eigen::Index row = first_row;
    for (std::size_t i = 0; i < clip.compared().size(); ++i) {
      const FitProblem::ComparedTrack& seen = clip.compared()[i];
      const TrackNoise& noise = clip.noise()[i];
      const Eigen::Index n = noise.num_rows();
      WhitenedTrack track{is_plain(problem) ? Vec3(seen.first.x(), seen.first.y(), 0) : points[i],
                          {},
                          at.jacobian.middleRows(row, n),
                          at.residuals.segment(row, n),
                          c};
      const int offset = seen.camera * per_camera;
      for (const int frame : seen.frames)
        for (const int axis : {0, 1}) track.rows.push_back(offset + 2 * frame + axis);
      for (int shift = 0; shift < noise.num_shifts(); ++shift)
        for (const int axis : {0, 1})
          track.rows.push_back(offset + (shift == 0 ? axis : 2 * (clip.frames() + shift) + axis));
      tracks.push_back(std::move(track));
      row += n;
    }
    first_row += clip.num_residuals();  // priors lie between the clips
  }
  return tracks;
}

std::map<std::string, double> truth_in_gauge(const JointFitInput& input, const JointProblem& problem,
                                             FitResult& result) {
  std::map<std::string, double> truth = input.truth;
  const std::string gauge = "/skin/layers/" + problem.gauge_layer() + "/youngs_modulus";
  const auto known = truth.find(gauge);
  // Measured forces tell the scale: then a held modulus that is not the truth's is an error like any other.
  if (problem.has_forces() || known == truth.end() || problem.modulus_variable(problem.gauge_layer()) >= 0)
    return truth;
  const double factor = get_parameter(input.clips[0].scene, gauge) / known->second;
  if (std::fabs(factor - 1) < 1e-12) return truth;
  for (auto& [address, value] : truth)
    if (address.ends_with("/youngs_modulus") || address.ends_with("/stiffness")) value *= factor;
  result.notes.push_back("True stiffnesses were multiplied by " + number("%.6g", factor) +
                         " for the comparison: the truth's modulus of layer " + problem.gauge_layer() +
                         " is not the one held.");
  return truth;
}

void add_modulus_ratios(const JointProblem& problem, const Identifiability& found, const VectorXd& t,
                        const std::map<std::string, double>& truth, FitResult& result) {
  const Scene scene = problem.clip(0).parametrisation().scene(problem.of_clip(0, t));
  const std::string base = problem.gauge_layer();
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
    const int above = problem.modulus_variable(layer.name), below = problem.modulus_variable(base);
    if (above < 0 && below < 0) continue;
    if (above >= 0) g[above] += problem.variables()[above].derivative(t[above]) / modulus(layer.name);
    if (below >= 0) g[below] -= problem.variables()[below].derivative(t[below]) / modulus(base);
    const double half = found.half_width(g);
    DerivedQuantity ratio{.name = "Young's modulus " + layer.name + " / " + base,
                          .unit = "",
                          .value = modulus(layer.name) / modulus(base),
                          .truth = {}};
    if ((above < 0) != (below < 0)) {
      ratio.follows = problem.variables()[std::max(above, below)].address;
      ratio.power = above >= 0 ? 1 : -1;
    }
    ratio.low95 = ratio.value * std::exp(-half);
    ratio.high95 = ratio.value * std::exp(half);
    const double true_ratio = true_modulus(layer.name) / true_modulus(base);
    if (std::isfinite(true_ratio)) ratio.truth = true_ratio;
    result.derived.push_back(std::move(ratio));
  }
}

void add_parameters(const JointProblem& problem, const VectorXd& t, const Identifiability* found,
                    const std::map<std::string, double>& truth, FitResult& result) {
  const VectorXd lower = problem.lower(), upper = problem.upper();
  for (int k = 0; k < problem.num_parameters(); ++k) {
    const FitVariable& v = problem.variables()[k];
    FittedParameter f{.address = v.address,
                      .name = v.name,
                      .unit = v.unit,
                      .transform = to_string(v.transform),
                      .initial = v.initial,
                      .value = std::clamp(v.to_parameter(t[k]), v.lower, v.upper),
                      .lower = v.lower,
                      .upper = v.upper,
                      .truth = {}};
    const double range = upper[k] - lower[k];
    f.at_bound = std::min(t[k] - lower[k], upper[k] - t[k]) < 1e-6 * range;
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

void add_residuals(const JointFitInput& input, JointProblem& problem, const VectorXd& t, FitResult& result) {
  for (int c = 0; c < problem.num_clips(); ++c) {
    const std::vector<MeasuredQuantities::Value> values = problem.clip(c).measured();
    const FitEvaluation& at = problem.clip(c).evaluate(problem.of_clip(c, t));
    for (std::size_t i = 0; i < values.size(); ++i) {
      const Measurement& m = values[i].measurement;
      result.measured.push_back({c, m.frame, m.quantity, m.value, m.sigma,
                                 m.value - m.sigma * at.measured[static_cast<Eigen::Index>(i)]});
    }
  }
  double sum = 0;
  for (int c = 0; c < problem.num_clips(); ++c) {
    FittedClip clip;
    add_clip(input.clips[c].tracks, problem.clip(c), problem.clip(c).evaluate(problem.of_clip(c, t)), c, clip,
             result);
    if (!is_plain(problem)) result.clips.push_back(std::move(clip));
  }
  for (const FitResidual& r : result.residuals)
    sum += Vec2(r.x_px - r.predicted_x_px, r.y_px - r.predicted_y_px).squaredNorm();
  result.rms_px = std::sqrt(sum / std::max<std::size_t>(1, result.residuals.size()));
}

void add_waves(const JointProblem& with_waves, JointProblem& problem, const VectorXd& t, FitResult& result) {
  for (int c = 0; c < problem.num_clips(); ++c) {
    const FitProblem& clip = with_waves.clip(c);
    if (!clip.waves()) continue;
    const std::vector<WaveDescription> tracked = clip.waves()->tracked(),
                                       predicted = clip.waves()->predicted(
                                           problem.clip(c).evaluate(problem.of_clip(c, t)).differences);
    for (std::size_t i = 0; i < tracked.size(); ++i) {
      const WaveDescription &a = tracked[i], &b = predicted[i];
      const std::string camera = clip.cameras().size() > 1 ? "_" + clip.cameras()[a.camera].name : "";
      constexpr double kDegrees = 57.29577951308232;
      const double turned = std::remainder(b.direction - a.direction, 3.141592653589793);
      result.measured.push_back(
          {c, a.frame, "waves_amplitude" + camera, a.amplitude, a.amplitude_sigma, b.amplitude});
      if (!(a.amplitude > 3 * a.amplitude_sigma)) continue;  // nothing to describe
      result.measured.push_back(
          {c, a.frame, "waves_length" + camera, a.wavelength, a.wavelength_sigma, b.wavelength});
      result.measured.push_back({c, a.frame, "waves_direction" + camera, kDegrees * a.direction,
                                 kDegrees * a.direction_sigma, kDegrees * (a.direction + turned)});
    }
    const Eigen::Matrix<double, 3, 2>& plane = clip.waves()->plane();
    result.notes.push_back(
        (problem.name(c).empty() ? std::string() : "Clip " + problem.name(c) + ": ") +
        "Waves in what tracks have moved led the search besides their points, by wave vector "
        "and not by phase; directions are from (" +
        number("%.2f, ", plane(0, 0)) + number("%.2f, ", plane(1, 0)) + number("%.2f", plane(2, 0)) +
        ") toward (" + number("%.2f, ", plane(0, 1)) + number("%.2f, ", plane(1, 1)) +
        number("%.2f", plane(2, 1)) + ").");
  }
}

void add_clip_chi_squares(const JointProblem& problem, const FitProblem::Linearised& at,
                          const Identifiability& found, FitResult& result) {
  Eigen::Index row = 0;
  for (std::size_t c = 0; c < result.clips.size(); ++c) {
    const FitProblem& problem_c = problem.clip(static_cast<int>(c));
    FittedClip& clip = result.clips[c];
    Eigen::Index rows = 0;  // of tracks; priors follow them
    for (const TrackNoise& noise : problem_c.noise()) rows += noise.num_rows();
    const double used = (at.jacobian.middleRows(row, rows) * found.basis()).squaredNorm();
    clip.degrees_of_freedom = std::max(1.0, 2 * problem_c.sum_of_weights() - used);
    clip.reduced_chi_square = at.residuals.segment(row, rows).squaredNorm() / clip.degrees_of_freedom;
    row += problem_c.num_residuals();
  }
}

void add_notes(const JointFitInput& input, JointProblem& problem, const VectorXd& t, bool has_point,
               FitResult& result) {
  for (int c = 0; c < problem.num_clips(); ++c) {
    note_tracks_left_out(problem.clip(c), input.options, result);
    note_head_motion(problem.clip(c), result);
  }
  note_weights(input, result);
  for (const std::string& sentence : input.path_notes) result.notes.push_back(sentence);
  result.notes.push_back(
      "Each track is weighted by its own covariance in every frame; the error of its first pixel, which "
      "places "
      "its material point, is carried into all its frames. Together they count as at least " +
      number("%.3g", input.options.min_sigma) + " px per axis.");
  if (input.options.robust_scale > 0 && has_point) {
    int discounted = 0;
    for (int c = 0; c < problem.num_clips(); ++c)
      for (const TrackNoise::Evaluation& track : problem.clip(c).evaluate(problem.of_clip(c, t)).tracks)
        discounted += static_cast<int>(
            std::count_if(track.weights.begin(), track.weights.end(), [](double w) { return w < 1; }));
    result.notes.push_back("Huber loss beyond " + number("%.3g", input.options.robust_scale) +
                           " standard deviations; " + std::to_string(discounted) + " of " +
                           std::to_string(problem.num_observations()) + " observations were discounted.");
  }
  result.notes.push_back("Damper scheme: " + to_string(input.clips[0].scene.time.damper) +
                         "; relaxation times and fractions depend on it.");
  for (const std::string& sentence : problem.differences()) result.notes.push_back("Warning: " + sentence);
  if (problem.gauge_is_free() && !problem.has_forces())
    result.notes.push_back(
        "Warning: every stiffness is fitted and there are no force data: absolute values are arbitrary, only "
        "ratios are meaningful. Leave one Young's modulus out of the fitted parameters.");
}

std::string interval_note(const JointProblem& problem, const NoiseCheck& noise,
                          const Identifiability& found) {
  return "95 % intervals: Student's t on " + std::to_string(problem.degrees_of_freedom()) +
         " degrees of freedom, standard deviations widened by " + number("%.3f", noise.widening) +
         " (reduced chi-square " + number("%.3f", noise.reduced_chi_square) +
         ", lag-1 autocorrelation of whitened residuals within tracks " +
         number("%.3f", noise.autocorrelation) +
         "), or what neighbouring tracks err alike where that is more (" +
         which_are_wider(found, problem.variables()) + ").";
}

namespace {

/// "a", "a and b", "a, b and c".
std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k)
    text += (k == 0 ? "" : k + 1 < names.size() ? ", " : " and ") + names[k];
  return text;
}

/// What of a parameter that is held, a number that is, or a path makes most of the deviations of `names`.
std::string hangs_on(const std::vector<std::string>& names, const SystematicShift& shift) {
  const std::string what = shift.name.substr(std::string("held ").size());
  const std::string start = listed(names) + (names.size() > 1 ? " hang on " : " hangs on ");
  if (!shift.axes.empty())
    return start + "how well the " + what + " is known: the table says what it moves. Measure it better" +
           (what.ends_with(" offset") ? ", or fit it (/fit/path_deviations fit)." : ".");
  if (shift.rms_px > 0)
    return start + "the " + what + ", which is held: the table says what it moves. Measure it.";
  return start + "a parameter that is held, " + what +
         ": the table says what it moves. Fit it too, or measure it.";
}

}  // namespace

void add_systematic_notes(const FitCase& options, FitResult& result) {
  if (!options.discretisation_check)
    result.notes.push_back(
        "What the discretisation does to the answer was not checked (/fit/discretisation_check): intervals "
        "take the elements and steps for exact.");
  if (result.systematic.empty()) return;
  result.notes.push_back(
      "Systematic: the tracks were predicted again with each kind of step finer and with numbers of the "
      "scene "
      "that are held but not known exactly off by their deviation, and differentiated by parameters that are "
      "held and by where paths are; by what that would move a parameter, to first order, its interval is "
      "wider, 1.96 times" +
      std::string(result.systematic.back().name == kTogether
                      ? " all together, of what is held by what the residuals leave of it."
                      : " each, in squares."));
  // One sentence for all parameters that the same thing moves.
  const auto is_most = [&](double variance, std::size_t k) {
    return variance > 0.5 * result.parameters[k].sigma * result.parameters[k].sigma;
  };
  // What moves one by more than all together is made up for by the others: residuals know their sum.
  const SystematicShift& last = result.systematic.back();
  const auto is_made_up_for = [&](double shift, std::size_t k) {
    return last.name == kTogether && std::fabs(shift) > (1 + 1e-9) * last.shift[k];
  };
  for (const SystematicShift& shift : result.systematic) {
    if (!shift.failure.empty() || !shift.is_held()) continue;
    std::vector<std::string> names;
    for (std::size_t k = 0; k < result.parameters.size(); ++k)
      if (is_most(shift.shift[k] * shift.shift[k], k) && !is_made_up_for(shift.shift[k], k))
        names.push_back(result.parameters[k].name);
    if (!names.empty()) result.cannot_tell.push_back(hangs_on(names, shift));
  }
  std::vector<std::pair<std::string, std::vector<std::string>>>
      limited;  // by the change that moves them most
  for (std::size_t k = 0; k < result.parameters.size(); ++k) {
    const SystematicShift* largest = nullptr;
    double finer = 0;
    for (const SystematicShift& shift : result.systematic) {
      if (!shift.failure.empty() || shift.is_held() || shift.name == kTogether) continue;
      finer += shift.shift[k] * shift.shift[k];
      if (largest == nullptr || std::fabs(shift.shift[k]) > std::fabs(largest->shift[k])) largest = &shift;
    }
    if (largest == nullptr || !is_most(finer, k)) continue;
    const auto found = std::find_if(limited.begin(), limited.end(),
                                    [&](const auto& entry) { return entry.first == largest->change; });
    if (found == limited.end())
      limited.push_back({largest->change, {result.parameters[k].name}});
    else
      found->second.push_back(result.parameters[k].name);
  }
  for (const auto& [change, names] : limited)
    result.cannot_tell.push_back("The discretisation, not the footage, limits " + listed(names) +
                                 ", most of all this: " + change + " would move " +
                                 (names.size() > 1 ? "them" : "it") + " as the table says.");
}

}  // namespace rhytid::fitting
