// rhytid track: footage to tracks of skin points, with their uncertainty.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <ostream>

#include "fitting/cameras.h"
#include "fitting/case.h"
#include "fitting/tracking/overlay.h"
#include "fitting/tracking/tracker.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tools/render/scene_masks.h"
#include "tools/render/track_record.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

constexpr double finger_margin_px = 4;  ///< the finger's edge is blurred and throws shadow

/// A frame of the overlay video as a PNG, since not everything shows videos.
void write_overlay_picture(const std::string& video, int frame, const std::string& path) {
  cv::VideoCapture capture(video);
  cv::Mat picture, last;
  for (int i = 0; i <= frame && capture.read(picture); ++i) last = picture.clone();
  std::vector<unsigned char> png;
  if (last.empty() || !cv::imencode(".png", last, png))
    throw InputError(path, "no picture", "a readable overlay");
  write_file(path, std::string(png.begin(), png.end()));
}

class TrackVerb : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "track",
        "follow skin points through footage",
        "Finds corners on the skin in the first frame and follows them with sub-pixel accuracy and a "
        "covariance each; skin under the projected finger of the scene is masked. Run it before fit. With "
        "--video it works on any footage without a case.",
        "case.json with its footage, camera and scene; or a video",
        "tracks.csv, overlay.mp4, overlay.png, track.json; beside rendered footage also the error against "
        "the truth",
        "rhytid track data/scenes/demo/case.json -o run/demo"};
  }
  bool file_is_optional() const override { return true; }
  void add_options(CLI::App& app) override {
    app.add_option("--video", video_, "footage to track, in place of the case's")->option_text("FILE");
    app.add_option("--roi", roi_, "region of interest in the first frame, px")
        ->expected(4)
        ->delimiter(',')
        ->option_text("X,Y,W,H");
    app.add_option("--max-tracks", max_tracks_, "at most this many tracks")->option_text("N");
    app.add_option("--frames", frames_, "only the first N frames")->option_text("N");
  }

  ExitCode run(VerbContext& context) override {
    cv::setNumThreads(context.options.threads);
    if (context.options.file.empty() && video_.empty())
      throw InputError("track", "neither a case nor --video", "one of the two");
    if (frames_ < 0) throw InputError("--frames", std::to_string(frames_), "1 or more");
    const std::string folder = context.output_folder();
    fitting::FrameSourceOptions footage;
    fitting::TrackerOptions options;
    std::optional<fitting::Camera> camera;
    footage.path = video_;
    if (context.options.file.empty()) {
      options.seeds.max_tracks = 300;
      apply_roi(std::nullopt, options);
    } else {
      const fitting::Case c = fitting::load_case(context.options.file, context.options.settings);
      if (video_.empty()) footage.path = fitting::footage_path(c, folder);
      camera = prepare(c, folder, context, options);
    }
    if (max_tracks_ > 0) options.seeds.max_tracks = max_tracks_;
    if (frames_ > 0) footage.last = frames_ - 1;
    return follow(context, footage, options, camera, folder);
  }

 private:
  /// The command line's region of interest wins over the case's.
  void apply_roi(const std::optional<std::array<double, 4>>& of_case,
                 fitting::TrackerOptions& options) const {
    std::array<double, 4> r{};
    if (of_case) r = *of_case;
    if (roi_.size() == 4) std::copy(roi_.begin(), roi_.end(), r.begin());
    options.seeds.region = cv::Rect(static_cast<int>(r[0]), static_cast<int>(r[1]), static_cast<int>(r[2]),
                                    static_cast<int>(r[3]));
  }

  /// What the case says about seeds and masks; returns its camera when there is one.
  std::optional<fitting::Camera> prepare(const fitting::Case& c, const std::string& folder,
                                         VerbContext& context, fitting::TrackerOptions& options) const {
    options.seeds.max_tracks = c.track.max_tracks;
    options.seeds.min_distance_px = c.track.min_distance;
    apply_roi(c.track.roi, options);
    const std::string path = fitting::camera_path(c, folder);
    if (c.camera.empty() && !fs::exists(path)) {
      context.progress.warning("no camera: tracks are not limited to the skin and the finger is not masked");
      return std::nullopt;
    }
    const fitting::Camera camera = fitting::read_camera(path);
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
    return camera;
  }

  static ExitCode follow(VerbContext& context, const fitting::FrameSourceOptions& footage,
                         fitting::TrackerOptions& options, const std::optional<fitting::Camera>& camera,
                         const std::string& folder) {
    const auto in_folder = [&folder](const char* name) { return (fs::path(folder) / name).string(); };
    fitting::FrameSource source(footage);
    if (camera && (source.size().width != camera->width || source.size().height != camera->height))
      throw InputError(
          footage.path,
          std::to_string(source.size().width) + " x " + std::to_string(source.size().height) + " px",
          "the size of the camera, " + std::to_string(camera->width) + " x " +
              std::to_string(camera->height) + " px");
    context.progress.stage("track", source.frames_asked());
    options.progress = [&context](const fitting::FrameCounts&, int processed, int) {
      context.progress.step_done(processed);
      return !context.progress.interrupted();
    };
    const fitting::TrackerResult result = fitting::track(source, options);
    if (result.report.end == fitting::TrackerEnd::interrupted) return ExitCode::interrupted;
    if (result.report.end == fitting::TrackerEnd::source_ended_early)
      context.progress.warning(footage.path + " ended after " +
                               std::to_string(result.report.frames_processed) + " of " +
                               std::to_string(result.report.frames_asked) + " frames");
    fitting::write_tracks(result.tracks, in_folder("tracks.csv"));

    context.progress.stage("overlay", 0);
    fitting::FrameSource again(footage);
    const fitting::OverlayReport overlay =
        fitting::write_overlay(again, result.tracks, options.camera, in_folder("overlay.mp4"));
    write_overlay_picture(overlay.path, 2 * overlay.frames / 3, in_folder("overlay.png"));

    std::optional<TrackingError> error;
    if (camera && fs::exists(in_folder("truth_motion.bin")))
      error = tracking_error(result.tracks, read_motion(in_folder("truth_motion.bin")), *camera);
    write_file(in_folder("track.json"), track_record(result.report, error).dump(2) + "\n");
    context.out << in_folder("tracks.csv") << ": " << fitting::summary(result.report) << '\n';
    if (error) {
      char text[320];
      std::snprintf(
          text, sizeof(text),
          "against the truth: rms %.3f px, median %.3f, 95 %% below %.3f; %d of %d observations are "
          "more than 1 px off (largest %.3f), the others rms %.3f; %.2f times the stated deviation "
          "(%d tracks, %d off the skin)",
          error->rms_px, error->median_px, error->p95_px, error->gross, error->observations,
          error->largest_px, error->inlier_rms_px, error->normalised, error->tracks, error->off_skin);
      context.out << text << '\n';
    }
    return ExitCode::ok;
  }

  std::string video_;
  std::vector<double> roi_;
  int max_tracks_ = 0, frames_ = 0;
};

}  // namespace

std::unique_ptr<Verb> make_verb_track() {
  return std::make_unique<TrackVerb>();
}

}  // namespace rhytid::tools
