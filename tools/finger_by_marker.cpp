#include "tools/finger_by_marker.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "fitting/tracking/tracker.h"
#include "sim/output/text.h"

namespace rhytid::tools {
namespace {

/// What is left at the points of a frame, and where they are.
void add_signs(const fitting::TrackSet& tracks, int frame, FingerFrame& out) {
  for (const fitting::Track& track : tracks.tracks) {
    const fitting::Observation* o = track.at(frame);
    if (o != nullptr && o->status == fitting::TrackStatus::ok)
      out.signs.push_back({o->pixel, out.lost.empty()});
  }
}

nlohmann::ordered_json record_of(const std::vector<fitting::Landmark>& marker,
                                 const fitting::MarkerMotion& motion, const MarkerJob& job) {
  using nlohmann::ordered_json;
  ordered_json points = ordered_json::array();
  for (std::size_t i = 0; i < marker.size(); ++i) {
    const fitting::Landmark& l = marker[i];
    points.push_back({{"name", l.name},
                      {"pixel", {l.pixel.x(), l.pixel.y()}},
                      {"point_mm", {l.point.x(), l.point.y(), l.point.z()}},
                      {"sigma_px", l.sigma},
                      {"tracked", static_cast<bool>(motion.is_tracked[i])},
                      {"off_px", {motion.shifts[i].x(), motion.shifts[i].y()}}});
  }
  return {{"marker", points},
          {"rotation", motion.turns ? "found" : "of the scene"},
          {"depth", job.options.depth_of_scene ? "of the scene" : "found"},
          {"points_off_in_deviations", motion.shift_scale},
          {"frames_off_in_deviations", motion.own_scale},
          {"other_tilt_deg", 180 / std::numbers::pi * motion.other_tilt},
          {"doubts", motion.doubts}};
}

void warn_of_lost(const std::vector<FingerFrame>& frames, Progress& progress) {
  std::size_t end = frames.size();
  while (end > 0 && !frames[end - 1].lost.empty()) --end;
  for (std::size_t f = 0; f < end; ++f)
    if (!frames[f].lost.empty())
      progress.warning("frame " + std::to_string(frames[f].index) + " is lost: " + frames[f].lost);
  if (end < frames.size())
    progress.warning("lost from frame " + std::to_string(frames[end].index) +
                     " on, where the path ends: " + frames[end].lost);
}

}  // namespace

std::vector<fitting::Landmark> read_marker_in(const MarkerJob& job, const fitting::Camera& camera) {
  std::vector<fitting::Landmark> marker = fitting::read_marker(job.file, job.sigma);
  fitting::require_in_picture(marker, camera.width, camera.height, job.track.window / 2 + 3);
  return marker;
}

MarkerFinding find_by_marker(const MarkerJob& job, const std::vector<fitting::Landmark>& marker,
                             fitting::FrameSource& source, const fitting::Camera& camera,
                             const std::vector<FingerFrame>& of_scene, Progress& progress) {
  MarkerFinding finding;
  fitting::TrackerOptions options;
  options.camera = camera.name;
  options.seeds.seeding = fitting::Seeding::points;
  for (const fitting::Landmark& l : marker) options.seeds.points.push_back(l.pixel);
  options.window_px = job.track.window;
  options.redetect = false;  // few points: their neighbours may be on another side of the finger
  options.model =
      job.track.model == "translation" ? fitting::WarpModel::translation : fitting::WarpModel::affine;
  progress.stage("finger", std::min(source.frames_asked(), static_cast<int>(of_scene.size())));
  options.progress = [&progress](const fitting::FrameCounts&, int processed, int) {
    progress.step_done(processed);
    return !progress.interrupted();
  };
  fitting::TrackerResult tracked = fitting::track(source, options);
  finding.asked = tracked.report.frames_asked;
  finding.interrupted = tracked.report.end == fitting::TrackerEnd::interrupted;
  if (finding.interrupted) return finding;
  const auto count = std::min(of_scene.size(), static_cast<std::size_t>(tracked.report.frames_processed));
  std::vector<BodyPose> path;
  for (std::size_t f = 0; f < count; ++f) path.push_back(of_scene[f].of_scene);
  const fitting::MarkerMotion motion =
      fitting::follow_marker(tracked.tracks, marker, camera, path, job.options, job.file);

  for (std::size_t f = 0; f < count; ++f) {
    const fitting::MarkerFrame& of_marker = motion.frames[f];
    FingerFrame& frame = finding.frames.emplace_back(of_scene[f]);
    frame.lost = of_marker.lost;
    frame.more["points"] = of_marker.seen;
    add_signs(tracked.tracks, frame.index, frame);
    if (!frame.lost.empty()) continue;
    frame.found = of_marker.pose;
    frame.covariance = of_marker.covariance;
    frame.own = of_marker.own;
    frame.shared = of_marker.covariance - of_marker.own;
    frame.across_sigma = of_marker.across_sigma;
    frame.depth_sigma = of_marker.depth_sigma;
    frame.rms = of_marker.rms;
    const Vec3 own = of_marker.own.diagonal().cwiseMax(0.0).cwiseSqrt();
    frame.more["own_sigma_mm"] = {own.x(), own.y(), own.z()};
    if (motion.turns) frame.more["turn_sigma_deg"] = 180 / std::numbers::pi * of_marker.turn_sigma;
    if (job.options.depth_of_scene) frame.more["depth_sigma_mm"] = nullptr;
    const double largest =
        Eigen::SelfAdjointEigenSolver<Mat3>(of_marker.own, Eigen::EigenvaluesOnly).eigenvalues()[2];
    finding.own_sigma = std::max(finding.own_sigma, std::sqrt(std::max(0.0, largest)));
  }
  for (std::size_t i = 0; i < marker.size(); ++i)
    if (!motion.is_tracked[i])
      progress.warning(
          marker[i].place + ": '" + marker[i].name +
          "' cannot be tracked (no texture about it, or gone in the next frame) and is left out");
  if (motion.other_tilt > 0)
    progress.warning(
        "the points nearly allow the finger to be tilted by " +
        short_text(180 / std::numbers::pi * motion.other_tilt, 2) +
        " degrees against what is taken, the one nearer to the scene's path: a point off the plane of the "
        "others decides, --hold-rotation does without");
  warn_of_lost(finding.frames, progress);
  finding.turns = motion.turns;
  finding.record = record_of(marker, motion, job);
  finding.record["frames_asked"] = finding.asked;
  finding.record["frames_processed"] = finding.frames.size();
  finding.doubts = motion.doubts;
  finding.tracks = std::move(tracked.tracks);
  return finding;
}

}  // namespace rhytid::tools
