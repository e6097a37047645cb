// Which observations of the tracks a fit compares, attached to the skin or to the head, and what they weigh.
#include <algorithm>
#include <cmath>

#include "fitting/fit_problem.h"
#include "sim/core/error.h"
#include "sim/core/units.h"

namespace rhytid::fitting {
namespace {

/// Footage and simulation must agree on when frame f is, to the rounding of time stamps: a wrong rate shows
/// within a few frames, long before it amounts to a frame.
void check_times(const Track& track, double frame_rate) {
  for (const Observation& o : track.observations)
    if (std::fabs(o.time_s - o.frame / frame_rate) > std::max(0.02 / frame_rate, 0.6e-3))
      throw InputError("tracks: track " + std::to_string(track.id) + ", frame " + std::to_string(o.frame),
                       std::to_string(o.time_s) + " s",
                       std::to_string(o.frame / frame_rate) + " s; the scene's /time/frame_rate is " +
                           format_quantity(frame_rate, dimension::frequency, 6) +
                           (o.time_s > 0 ? ", the footage's about " +
                                               format_quantity(o.frame / o.time_s, dimension::frequency, 6)
                                         : std::string()));
}

void add(const RegistrationReport& one, RegistrationReport& all) {
  all.registered += one.registered;
  all.not_seen += one.not_seen;
  all.missed_mesh += one.missed_mesh;
  all.back_side += one.back_side;
  all.near_rim += one.near_rim;
  all.not_refined += one.not_refined;
}

std::vector<adjoint::MaterialPoint> points_of(const Registration& found) {
  std::vector<adjoint::MaterialPoint> points;
  for (const RegisteredTrack& r : found.tracks) points.push_back(r.point);
  return points;
}

}  // namespace

double frame_weight(const std::vector<FrameWeight>& rules, int frame) {
  double weight = 1;
  for (const FrameWeight& rule : rules)
    if (frame >= rule.from && (rule.to == 0 || frame <= rule.to))
      weight = rule.weight * (rule.half_every > 0 ? std::exp2(-(frame - rule.from) / rule.half_every) : 1);
  return weight < kLeastWeight ? 0 : weight;
}

void FitProblem::attach(const Scene& scene, const FitCase& fit, const Camera& camera, int number,
                        const TrackSet& tracks, const SkinMesh& seen_first) {
  if (fit.still.empty()) {
    const Registration found = register_tracks(tracks, camera, seen_first, fit.rim_margin);
    choose_observations(tracks, fit, number, found, nullptr);
    return add(found.report, registration_.report);
  }
  const std::vector<StillTrack> still = find_still_tracks(tracks, camera, scene.skin.surface, fit.still);
  head_motion_.push_back(estimate_head_motion(tracks, still, camera, options_.frames,
                                              fit.min_sigma / std::sqrt(2.), fit.robust_scale));
  TrackSet others = tracks;  // under the same numbers
  for (const StillTrack& s : still) others.tracks[s.track].camera.clear();
  const Registration found = register_tracks(others, camera, seen_first, fit.rim_margin);
  choose_observations(tracks, fit, number, found, &head_motion_.back());
  add(found.report, registration_.report);
}

void FitProblem::choose_observations(const TrackSet& tracks, const FitCase& fit, int camera,
                                     const Registration& found, const HeadMotion* motion) {
  const int first = std::max(1, fit.first_frame);
  const double floor =
      fit.min_sigma / std::sqrt(2.);  // of the two parts of a displacement's variance, half each
  const adjoint::PointInterpolation at(model_.model().mesh, points_of(found));
  const VectorXd rest = VectorXd::Zero(3 * model_.model().mesh.num_nodes());
  for (std::size_t k = 0; k < found.tracks.size(); ++k) {
    const RegisteredTrack& r = found.tracks[k];
    Track track = tracks.tracks[r.track];
    check_times(track, options_.frame_rate);
    if (motion != nullptr) {
      const Vec3 point = at.position(static_cast<int>(k), rest);
      for (Observation& o : track.observations)
        if (o.frame > 0 && o.frame <= options_.frames && o.status == TrackStatus::ok)
          o.covariance += motion->pixel_covariance(o.frame, point);
    }
    ComparedTrack compared{r.track, camera, track.at(0)->pixel, {}, {}};
    const double of_first = with_floor(track.at(0)->covariance, floor).trace() / 2;
    std::vector<const Observation*> used_observations;
    std::vector<double> weights;
    for (const Observation& o : track.observations) {
      if (o.status != TrackStatus::ok || o.frame < first || o.frame > options_.frames) continue;
      if (motion != nullptr && !motion->known[o.frame]) continue;
      const double weight = frame_weight(fit.frame_weights, o.frame);
      if (weight == 0) {
        ++weighed_away_;
        continue;
      }
      weights.push_back(weight);
      compared.frames.push_back(o.frame);
      compared.observed.push_back(o.pixel);
      compared.variances.push_back((of_first + with_floor(o.covariance, floor).trace() / (2 * weight)) /
                                   fit.clip_weight);
      used_observations.push_back(&o);
    }
    if (compared.frames.empty()) continue;
    num_observations_ += static_cast<int>(compared.frames.size());
    for (const double weight : weights) sum_of_weights_ += weight * fit.clip_weight;
    noise_.emplace_back(track, used_observations, floor, fit.robust_scale,
                        TrackWeights{std::move(weights), fit.clip_weight});
    compared_.push_back(std::move(compared));
    registration_.tracks.push_back(r);
  }
}

std::vector<WavePoint> FitProblem::wave_points() const {
  const std::vector<Vec3> rest = rest_points();
  std::vector<WavePoint> points;
  for (std::size_t i = 0; i < compared_.size(); ++i) {
    const ComparedTrack& c = compared_[i];
    WavePoint& p = points.emplace_back();
    p.rest = rest[i], p.camera = c.camera, p.frames = c.frames, p.variances = c.variances;
    p.moved.resize(2 * static_cast<Eigen::Index>(c.frames.size()));
    for (std::size_t j = 0; j < c.frames.size(); ++j)
      p.moved.segment<2>(2 * static_cast<Eigen::Index>(j)) = c.observed[j] - c.first;
  }
  return points;
}

void FitProblem::require_observations(const FitCase& fit, const std::vector<Camera>& cameras) const {
  if (num_observations_ == 0 && weighed_away_ > 0)
    throw InputError(
        "fit: /fit/frame_weights",
        "a weight of 0, or below 1e-9, for all " + std::to_string(weighed_away_) + " usable observations",
        "a weight in frames that are compared");
  std::string names;
  for (const Camera& camera : cameras) names += (names.empty() ? "'" : ", '") + camera.name + "'";
  for (std::size_t c = 0; c < cameras.size() && cameras.size() > 1; ++c)
    if (std::none_of(compared_.begin(), compared_.end(),
                     [&](const ComparedTrack& t) { return t.camera == static_cast<int>(c); }))
      throw InputError("fit: tracks of camera '" + cameras[c].name + "'", "no usable observation",
                       "tracks that are seen in frame 0 on the skin; or leave the camera out");
  const auto fitted = std::count_if(fit.parameters.begin(), fit.parameters.end(),
                                    [](const FitParameter& p) { return !p.is_held; });
  if (2 * num_observations_ <= fitted)
    throw InputError("fit: tracks of camera " + names,
                     std::to_string(num_observations_) + " usable observations in frames " +
                         std::to_string(std::max(1, fit.first_frame)) + ".." +
                         std::to_string(options_.frames) + " (" +
                         std::to_string(registration_.report.not_seen) + " tracks not seen in frame 0, " +
                         std::to_string(registration_.report.missed_mesh) + " beside the skin, " +
                         std::to_string(registration_.report.back_side) + " on its back, " +
                         std::to_string(registration_.report.near_rim) + " near the rim)",
                     "more numbers than the " + std::to_string(fitted) + " parameters");
}

}  // namespace rhytid::fitting
