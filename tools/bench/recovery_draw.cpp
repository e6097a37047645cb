#include "tools/bench/recovery_draw.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include "fitting/fit.h"
#include "fitting/parametrisation.h"
#include "fitting/tracking/tracker.h"
#include "sim/core/error.h"
#include "sim/scene/names.h"
#include "tools/bench/timing.h"

namespace rhytid::tools {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Columns of a parameter are "what address"; addresses have no blanks.
const std::vector<std::string> kOfParameter = {"truth", "value", "low95",    "high95",
                                               "error", "sigma", "transform"};

std::size_t transform_index(const std::string& word) {
  const auto& words = EnumNames<ParameterTransform>::words;
  return static_cast<std::size_t>(std::find(words.begin(), words.end(), word) - words.begin());
}

double in_coordinate(const fitting::FittedParameter& p, double value) {
  fitting::FitVariable v;
  v.transform = static_cast<ParameterTransform>(transform_index(p.transform));
  v.lower = p.lower, v.upper = p.upper;
  return v.to_transformed(value);
}

/// Tracks of the footage, as a fit reads them; nothing when interrupted.
std::optional<fitting::TrackSet> tracks_of(const TrackJob& job, const std::string& path, int keep_every,
                                           Progress& progress) {
  fitting::FrameSource source(job.footage);
  fitting::TrackerOptions options = job.options;
  options.progress = [&progress](const fitting::FrameCounts&, int, int) { return !progress.interrupted(); };
  const fitting::TrackerResult tracked = fitting::track(source, options);
  if (tracked.report.end == fitting::TrackerEnd::interrupted) return std::nullopt;
  fitting::TrackSet kept;
  for (std::size_t i = 0; i < tracked.tracks.tracks.size(); i += static_cast<std::size_t>(keep_every))
    kept.tracks.push_back(tracked.tracks.tracks[i]);
  fitting::write_tracks(kept, path);
  return fitting::read_tracks(path);
}

}  // namespace

VariantResult draw_result(const RecoveryDraw& draw, const VariantIdentity& identity) {
  VariantResult result{
      std::to_string(draw.draw), identity, draw.answered ? "complete" : "not_converged", draw.status, {}};
  const auto add = [&result](const std::string& name, const std::string& unit, double value) {
    result.columns.push_back({name, unit, std::isfinite(value) ? std::optional(value) : std::nullopt});
  };
  add("draw", "", draw.draw);
  add("reduced_chi_square", "", draw.reduced_chi_square);
  add("rms", "px", draw.rms_px);
  add("tracks", "", draw.tracks);
  add("observations", "", draw.observations);
  add("forward_runs", "", draw.forward_runs);
  add("cpu", "s", draw.cpu_seconds);
  add("wall", "s", draw.seconds);
  for (const RecoveredParameter& p : draw.parameters) {
    const std::vector<double> values = {p.truth,
                                        p.value,
                                        p.low95,
                                        p.high95,
                                        p.error,
                                        p.sigma,
                                        static_cast<double>(transform_index(p.transform))};
    for (std::size_t k = 0; k < values.size(); ++k) add(kOfParameter[k] + " " + p.address, p.unit, values[k]);
  }
  return result;
}

RecoveryDraw read_draw(const VariantResult& result) {
  std::map<std::string, double> values;
  RecoveryDraw draw;
  for (const ResultColumn& c : result.columns) {
    values[c.name] = c.value.value_or(kNan);
    if (c.name.starts_with("truth ")) draw.parameters.push_back({c.name.substr(6), c.unit, "none"});
  }
  const auto count = [&values](const char* name) {
    const double value = values[name];
    return std::isfinite(value) ? static_cast<int>(value) : 0;
  };
  draw.draw = count("draw"), draw.tracks = count("tracks"), draw.observations = count("observations");
  draw.forward_runs = count("forward_runs");
  draw.answered = result.status == "complete", draw.status = result.reason;
  draw.reduced_chi_square = values["reduced_chi_square"], draw.rms_px = values["rms"];
  draw.cpu_seconds = values["cpu"], draw.seconds = values["wall"];
  for (RecoveredParameter& p : draw.parameters) {
    const auto of = [&](const char* what) { return values[std::string(what) + " " + p.address]; };
    p.truth = of("truth"), p.value = of("value"), p.low95 = of("low95"), p.high95 = of("high95");
    p.error = of("error"), p.sigma = of("sigma");
    const auto& words = EnumNames<ParameterTransform>::words;
    const double word = of("transform");
    if (word >= 0 && word < static_cast<double>(words.size()))
      p.transform = words[static_cast<std::size_t>(word)];
  }
  return draw;
}

std::vector<RecoveredParameter> recovered_parameters(const fitting::FitResult& result) {
  std::vector<RecoveredParameter> all;
  for (const fitting::FittedParameter& p : result.parameters) {
    if (!p.truth) continue;
    all.push_back({p.address, p.unit, p.transform, *p.truth, p.value, p.low95, p.high95,
                   in_coordinate(p, p.value) - in_coordinate(p, *p.truth), p.determined ? p.sigma : kNan});
  }
  return all;
}

std::optional<RecoveryDraw> run_recovery_draw(const RecoveryTwin& twin, const DrawSetup& setup, int draw,
                                              const std::string& own, Progress& progress) {
  const double begin = clock_seconds(), cpu_begin = cpu_seconds();
  const fitting::Case& c = setup.varied.c;
  TrackJob job = setup.job;
  job.footage.path = own + "/footage" + (c.render.codec == "h264" ? ".mp4" : ".avi");
  twin.film(c.render, c.render.seed + static_cast<unsigned>(draw), job.footage.path);
  RecoveryDraw found;
  found.draw = draw;
  try {
    const auto tracks = tracks_of(job, own + "/tracks.csv", setup.varied.keep_every, progress);
    if (!tracks) return std::nullopt;
    fitting::FitInput input{.scene = setup.fit,
                            .camera = twin.camera,
                            .tracks = *tracks,
                            .options = c.fit,
                            .truth = fitting::read_truth(setup.folder + "/truth.json", setup.fit)};
    for (const fitting::StageCase& stage : c.fit.stages)
      input.stages.push_back(fitting::scenes_of_stage(c, stage)[0]);
    fitting::FitObserver observer;
    observer.should_stop = [&progress] { return progress.interrupted(); };
    const fitting::FitResult result = fitting::run_fit(input, observer);
    if (result.stopped) return std::nullopt;
    found.answered = result.converged, found.status = result.status;
    found.parameters = recovered_parameters(result);
    found.reduced_chi_square = result.reduced_chi_square, found.rms_px = result.rms_px;
    found.tracks = result.num_tracks, found.observations = result.num_observations;
    found.forward_runs = result.forward_runs;
  } catch (const InputError& error) {
    found.status = error.what();  // no point to track, no track on the skin: of this draw
  }
  std::filesystem::remove(job.footage.path);
  found.cpu_seconds = cpu_seconds() - cpu_begin, found.seconds = clock_seconds() - begin;
  return found;
}

}  // namespace rhytid::tools
