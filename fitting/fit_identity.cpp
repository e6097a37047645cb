// The digests by which a log of evaluations knows its own fit.
#include "fitting/evaluation_log.h"
#include "fitting/fit.h"
#include "sim/core/digest.h"
#include "sim/scene/load.h"
#include "sim/time/model_digest.h"
#include "sim/time/program_digest.h"

namespace rhytid::fitting {
namespace {

std::string scene_digest(const Scene& scene, const FitProblem& problem) {
  nlohmann::json json = scene_to_json(scene);
  for (const char* key : {"name", "description", "output"}) json.erase(key);
  Digest d;
  d.text(json.dump());
  d.text(content_digest(problem.scene_model().model()));  // files may change under the same name
  return d.hex();
}

std::string tracks_digest(const TrackSet& tracks) {
  Digest d;
  for (const Track& track : tracks.tracks) {
    d.number(track.id);
    d.text(track.camera);
    for (const Observation& o : track.observations) {
      d.number(o.frame);
      d.number(o.time_s);
      d.number(static_cast<double>(o.status));
      if (o.status != TrackStatus::ok) continue;
      d.matrix(o.pixel);
      d.matrix(o.covariance);
      d.number(o.renewed ? 1 : 0);
    }
  }
  return d.hex();
}

/// Poses of a head that moves come from a surface that the scene crops: its files may change beside the patch.
std::string head_digest(const FitProblem& problem) {
  if (problem.head_motion().empty()) return {};
  Digest d;
  for (const HeadMotion& motion : problem.head_motion())
    for (const Camera& camera : motion.cameras) {
      d.matrix(camera.rotation);
      d.matrix(camera.translation);
    }
  return d.hex();
}

std::string measured_digest(const std::vector<Measurement>& measured) {
  if (measured.empty()) return {};
  Digest d;
  for (const Measurement& m : measured) {
    d.number(m.frame);
    d.text(m.quantity);
    d.number(m.value);
    d.number(m.sigma);
  }
  return d.hex();
}

std::string parameters_digest(const FitCase& fit, const Parametrisation& parametrisation) {
  Digest d;
  for (const FitVariable& v : parametrisation.variables()) {
    d.text(v.address);
    d.number(static_cast<double>(v.transform));
    for (const auto& [address, amount] : v.moves) {
      d.text(address);
      d.number(amount);
    }
    for (const double x : {v.initial, v.lower, v.upper, v.prior_sigma.value_or(0)}) d.number(x);
  }
  d.text(parametrisation.gauge_layer());
  for (const double x : {fit.robust_scale, fit.min_sigma, static_cast<double>(fit.first_frame),
                         static_cast<double>(fit.last_frame), fit.rim_margin})
    d.number(x);
  // Each says what it is: numbers alone could be those of another. None: the log of before there were any.
  if (!fit.frame_weights.empty()) d.text("frame_weights");
  for (const FrameWeight& rule : fit.frame_weights)
    for (const double x :
         {static_cast<double>(rule.from), static_cast<double>(rule.to), rule.weight, rule.half_every})
      d.number(x);
  if (fit.waves) {
    d.text("waves");
    for (const double x : {fit.waves->shortest, fit.waves->longest, fit.waves->tolerance}) d.number(x);
  }
  if (fit.clip_weight != 1) {
    d.text("clip_weight");
    d.number(fit.clip_weight);
  }
  for (const StillRegion& region : fit.still) {
    d.matrix(region.low);
    d.matrix(region.high);
  }
  if (fit.wrinkles) {
    d.matrix(fit.wrinkles->line.from);
    d.matrix(fit.wrinkles->line.to);
    for (const double x :
         {static_cast<double>(fit.wrinkles->points), fit.wrinkles->band.shortest, fit.wrinkles->band.longest})
      d.number(x);
  }
  return d.hex();
}

}  // namespace

FitIdentity fit_identity(const FitInput& input, const FitProblem& problem) {
  return fit_identity(FitClip{{}, {}, input.scene, {input.camera}, input.tracks}, input.options, problem);
}

FitIdentity fit_identity(const FitClip& clip, const FitCase& given, const FitProblem& problem) {
  FitCase options = given;
  options.clip_weight = clip.weight;
  std::string cameras;
  for (const Camera& camera : clip.cameras) cameras += camera_digest(camera);
  return {{"program", program_digest()},
          {"scene", scene_digest(clip.scene, problem)},
          {"camera", cameras},
          {"tracks", tracks_digest(clip.tracks) + measured_digest(clip.measured) + head_digest(problem)},
          {"parameters", parameters_digest(options, problem.parametrisation())}};
}

}  // namespace rhytid::fitting
