#include "tools/track_footage.h"

#include <cstdio>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <ostream>

#include "fitting/case_camera.h"
#include "fitting/tracking/overlay.h"
#include "fitting/tracking/there_and_back.h"
#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tools/footage_record.h"
#include "tools/render/scene_masks.h"
#include "tools/render/track_record.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

constexpr double finger_margin_px = 4;  ///< the finger's edge is blurred and throws shadow

/// A frame of the overlay video as a PNG, since not everything shows videos.
void write_overlay_picture(const std::string& video, int frame, const std::string& path) {
  fitting::FrameSourceOptions options;
  options.path = video;
  options.first = options.last = frame;
  const std::optional<fitting::Frame> picture = fitting::FrameSource(options).next();
  std::vector<unsigned char> png;
  if (!picture || !cv::imencode(".png", picture->colour, png))
    throw InputError(path, "no picture", "a readable overlay");
  write_file(path, std::string(png.begin(), png.end()));
}

std::string in(const std::string& folder, const char* name) {
  return (fs::path(folder) / name).string();
}

/// Of the masks of skin and finger as they are, so that changes of the scene that do not show leave tracks
/// valid.
std::string masks_digest(const TrackJob& job, const Scene& scene) {
  Digest digest;
  const auto add = [&digest](const cv::Mat& mask) {
    for (int row = 0; row < mask.rows; ++row) digest.bytes(mask.ptr(row), static_cast<size_t>(mask.cols));
  };
  add(job.options.seeds.region_mask);
  fitting::Frame frame;
  for (frame.index = 0; job.options.mask && frame.index <= scene.time.frames; ++frame.index) {
    frame.time_s = frame.index / scene.time.frame_rate;
    add(job.options.mask(frame));
  }
  return digest.hex();
}

/// Seeds on the skin, finger masked, as the camera sees both at rest and in every frame.
void use_camera(const fitting::Case& c, TrackJob& job) {
  const fitting::Camera camera = *job.camera;
  fitting::TrackerOptions& options = job.options;
  options.camera = camera.name;
  const Scene scene = load_scene(c.scene, c.scene_settings);
  const MovingSurface patch = outer_surface(SceneModel(scene).model().mesh, "");
  options.seeds.region_mask = patch_mask(patch, camera, options.window_px / 2);
  if (c.track.mask_finger) {
    const Vec3 direction = finger_direction(patch.mean_normal(), camera);
    options.mask = [scene, direction, camera](const fitting::Frame& frame) {
      return finger_mask(scene, frame.time_s, direction, camera, finger_margin_px);
    };
  }
  job.masks_digest = masks_digest(job, scene);
}

void use_settings(const fitting::TrackCase& track, TrackJob& job) {
  fitting::TrackerOptions& options = job.options;
  options.seeds.max_tracks = track.max_tracks;
  options.seeds.min_distance_px = track.min_distance;
  options.window_px = track.window;
  options.redetect = track.redetect;
  options.exposure = track.exposure;
  options.model = track.model == "translation" ? fitting::WarpModel::translation : fitting::WarpModel::affine;
  if (!track.roi) return;
  const auto& r = *track.roi;
  options.seeds.region = cv::Rect(static_cast<int>(r[0]), static_cast<int>(r[1]), static_cast<int>(r[2]),
                                  static_cast<int>(r[3]));
}

void print_error(const TrackingError& error, std::ostream& out) {
  char text[400];
  std::snprintf(text, sizeof(text),
                "against the truth: rms %.3f px, median %.3f, 95 %% below %.3f; %d of %d observations are "
                "more than 1 px off (largest %.3f), the others rms %.3f; %.2f times the stated deviation, "
                "reduced chi-square for a fit %.2f (%d tracks, %d off the skin)",
                error.rms_px, error.median_px, error.p95_px, error.gross, error.observations,
                error.largest_px, error.inlier_rms_px, error.normalised, error.reduced_chi_square,
                error.tracks, error.off_skin);
  out << text << '\n';
}

/// An empty digest is null: without a camera there is none.
nlohmann::json digest_or_null(const std::string& digest) {
  return digest.empty() ? nlohmann::json() : nlohmann::json(digest);
}

}  // namespace

nlohmann::json track_settings(const TrackJob& job) {
  const fitting::SeedOptions& seeds = job.options.seeds;
  const cv::Rect& r = seeds.region;
  return {{"camera", digest_or_null(job.camera_digest)},
          {"masks of skin and finger", digest_or_null(job.masks_digest)},
          {"model", job.options.model == fitting::WarpModel::translation ? "translation" : "affine"},
          {"max_tracks", seeds.max_tracks},
          {"min_distance", seeds.min_distance_px},
          {"window", job.options.window_px},
          {"redetect", job.options.redetect},
          {"exposure", job.options.exposure ? nlohmann::json(*job.options.exposure) : nlohmann::json()},
          {"roi", r.empty() ? nlohmann::json() : nlohmann::json({r.x, r.y, r.width, r.height})},
          {"last frame", job.footage.last}};
}

TrackJob track_job(const std::string& video, const fitting::TrackCase& track) {
  TrackJob job;
  job.footage.path = video;
  use_settings(track, job);
  return job;
}

TrackJob track_job(const fitting::Case& c, const std::string& folder, const std::string& video,
                   Progress& progress, const std::optional<fitting::TrackCase>& asked) {
  TrackJob job;
  const std::string of_case = fitting::footage_path(c, folder);
  job.footage.path = video.empty() ? of_case : video;
  job.is_other_video = job.footage.path != of_case;
  job.noise = c.fit;
  use_settings(c.track, job);
  // Rendered footage and its truth lie side by side; another video has nothing to do with that truth.
  const std::string motion = in(folder, "truth_motion.bin");
  std::error_code ignored;
  const fs::path beside = fs::path(folder) / fs::path(of_case).filename();
  if (fs::exists(motion, ignored) && fs::equivalent(job.footage.path, beside, ignored) &&
      is_truth_of(in(folder, "truth.json"), job.footage.path, ""))
    job.truth_motion = motion;

  const std::string path = fitting::case_camera_file(c, folder);
  if (c.camera.empty() && !fs::exists(path)) {
    progress.warning("no camera: tracks are not limited to the skin and the finger is not masked");
  } else {
    job.camera = fitting::read_camera(path);
    job.camera_digest = file_digest(path);
    use_camera(c, job);
  }
  job.of_case = track_settings(job);
  if (asked) use_settings(*asked, job);
  if (job.camera && asked && asked->window != c.track.window)
    use_camera(c, job);  // the windows stay on the skin
  return job;
}

namespace {

void draw_tracks(const TrackJob& job, const fitting::TrackSet& tracks, const std::string& folder,
                 Progress& progress) {
  progress.stage("drawing the tracks over the footage", 0);
  for (const char* name : {"overlay.mp4", "overlay.avi"})  // of earlier tracks, perhaps by another encoder
    if (fs::is_regular_file(in(folder, name))) fs::remove(in(folder, name));
  fitting::FrameSource again(job.footage);
  const fitting::OverlayReport overlay =
      fitting::write_overlay(again, tracks, job.options.camera, in(folder, "overlay.mp4"));
  write_overlay_picture(overlay.path, 2 * overlay.frames / 3, in(folder, "overlay.png"));
}

}  // namespace

ExitCode track_footage(const TrackJob& job, const std::string& folder, int threads, Progress& progress,
                       std::ostream& out) {
  cv::setNumThreads(threads);
  fitting::TrackerOptions options = job.options;
  const std::optional<fitting::Camera>& camera = job.camera;
  fitting::FrameSource source(job.footage);
  if (camera && (source.size().width != camera->width || source.size().height != camera->height))
    throw InputError(
        job.footage.path,
        std::to_string(source.size().width) + " x " + std::to_string(source.size().height) + " px",
        "the size of the camera, " + std::to_string(camera->width) + " x " + std::to_string(camera->height) +
            " px");
  // Taken before the footage is read: when it changes meanwhile, the tracks are known to be of something
  // else.
  const nlohmann::json footage = footage_record(job.footage.path);
  progress.stage("track", source.frames_asked());
  options.progress = [&progress](const fitting::FrameCounts&, int processed, int) {
    progress.step_done(processed);
    return !progress.interrupted();
  };
  const fitting::TrackerResult result = fitting::track(source, options);
  if (result.report.end == fitting::TrackerEnd::interrupted) return ExitCode::interrupted;
  if (result.report.end == fitting::TrackerEnd::source_ended_early)
    progress.warning(job.footage.path + " ended after " + std::to_string(result.report.frames_processed) +
                     " of " + std::to_string(result.report.frames_asked) + " frames");
  std::optional<fitting::ThereAndBack> returned;
  if (job.there_and_back) {
    progress.stage("track back", result.report.frames_processed);
    options.exposure =
        result.report.exposure;  // the same both ways, or their difference would count as drift
    returned = fitting::there_and_back(job.footage, result.tracks, options);
    if (!returned) return ExitCode::interrupted;
  }
  std::optional<TrackingError> error;
  if (camera && !job.truth_motion.empty())
    error = tracking_error(result.tracks, read_motion(job.truth_motion), *camera, job.noise);
  const nlohmann::json settings = track_settings(job);
  nlohmann::json record = track_record(result.report, returned, error);
  record.update(tracks_record(footage, settings, job.of_case, job.is_other_video || settings != job.of_case));
  write_file(in(folder, "track.json"), unfinished_tracks_record().dump() + "\n");
  fitting::write_tracks(result.tracks, in(folder, "tracks.csv"));
  // The record comes last: where it is whole, the pictures are there too, also after a kill. Tracks without
  // pictures, for want of an encoder, are whole all the same.
  const auto finish = [&] { write_file(in(folder, "track.json"), record.dump(2) + "\n"); };
  try {
    draw_tracks(job, result.tracks, folder, progress);
  } catch (...) {
    finish();
    throw;
  }
  finish();

  out << in(folder, "tracks.csv") << ": " << fitting::summary(result.report) << '\n';
  if (returned) out << fitting::summary(*returned) << '\n';
  if (error) print_error(*error, out);
  return ExitCode::ok;
}

}  // namespace rhytid::tools
