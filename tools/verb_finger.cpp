// rhytid finger: the path of the finger from footage, by its outline or by a marker on it.
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>

#include "fitting/case.h"
#include "fitting/case_camera.h"
#include "fitting/finger_outline.h"
#include "fitting/tracking/frame_source.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/load.h"
#include "sim/scene/names.h"
#include "tools/clip_argument.h"
#include "tools/finger_by_marker.h"
#include "tools/finger_files.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// The collider that is meant; the only one, or the one named. Throws InputError, too for what has no outline
/// of its own when that is what is followed.
const ColliderScene& chosen_collider(const Scene& scene, const std::string& file, const std::string& name,
                                     bool by_outline) {
  const ColliderScene* chosen = nullptr;
  std::string names;
  for (const ColliderScene& c : scene.colliders) {
    names += (names.empty() ? "" : ", ") + c.name;
    if (c.name == name || (name.empty() && scene.colliders.size() == 1)) chosen = &c;
  }
  if (scene.colliders.empty()) throw InputError(file + ": /colliders", "none", "a sphere: the finger");
  if (chosen == nullptr)
    throw InputError("--collider", name.empty() ? "nothing" : "'" + name + "'", "one of " + names);
  if (by_outline && chosen->shape != ShapeKind::sphere)
    throw InputError(
        file + ": /colliders/" + chosen->name + "/shape", "'" + to_string(chosen->shape) + "'",
        "a sphere: the outline of another shape also depends on how it is turned (--marker follows any)");
  return *chosen;
}

/// Where the scene has the finger, by frame.
std::vector<FingerFrame> frames_of_scene(const Scene& scene, const ColliderScene& collider) {
  const ColliderMotion motion(collider, scene.time.offset);
  std::vector<FingerFrame> frames;
  for (int f = 0; f <= scene.time.frames; ++f) {
    FingerFrame& frame = frames.emplace_back();
    const double time = f / scene.time.frame_rate;
    frame.index = f;
    frame.time = time + scene.time.offset;
    frame.of_scene = frame.found = motion.at(time);
  }
  return frames;
}

/// Frames that are shown: four, spread evenly.
bool is_shown(int frame, std::size_t shown, int asked) {
  return shown < 4 && frame >= static_cast<int>(shown) * (asked - 1) / 3;
}

class FingerVerb final : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "finger",
        "the path of the finger from footage, by its outline or by a marker on it",
        "Follows the outline of a spherical collider through the footage and writes where its centre was in "
        "every frame, as a path for the scene. The search starts each frame at the scene's path, corrected "
        "by "
        "what the frame before needed, so that path need be right to some px only (--window). The radius "
        "must "
        "be right: one per cent of radius is one per cent of the distance to the camera. Along the line of "
        "sight "
        "the centre is known worst. Parts of the outline that are hidden are left out; a frame with less "
        "than a "
        "third of it is lost.\n"
        "With --marker it follows dots on the nail or finger instead, for a collider of any shape. Name the "
        "pixel of "
        "each in the first frame and its place on the finger, from the collider's centre along the "
        "collider's axes (as "
        "long as the scene does not turn it: the scene's). Four dots or more, not on a line, tell how the "
        "finger turns "
        "too; two or three only where it is, by their distance how far from the camera; one is refused "
        "without "
        "--depth-of-scene. What pixels and places are off by shifts the whole path alike: finger.json has "
        "deviations "
        "with it (sigma_mm) and without (own_sigma_mm).\n"
        "Exit 3 when more than half of the frames are lost, or the marker's points do not agree.",
        "case.json with its footage, camera and scene; with --marker a CSV of name,x_px,y_px,x_mm,y_mm,z_mm, "
        "and maybe "
        "sigma_px",
        "finger.csv (for /colliders/NAME/path_file; a fit takes its deviations into account), finger.json "
        "(deviations, edges or points used), "
        "finger.png (four "
        "frames: blue the scene's outline, green the one found); with --marker finger_tracks.csv. Prints how "
        "far it is "
        "from the scene's path",
        "rhytid finger case.json --marker dots.csv -o run/finger"};
  }
  bool takes_case() const override { return true; }
  void add_options(CLI::App& app) override {
    app.add_option("--collider", collider_, "which collider of the scene (default: the only one)")
        ->option_text("NAME");
    CLI::Option* window = app.add_option("--window", window_,
                                         "how far from where it is expected an edge is looked for, px (12)")
                              ->option_text("PX")
                              ->check(CLI::Range(4.0, 60.0));
    CLI::Option* marker = app.add_option("--marker", marker_.file,
                                         "CSV of points on the finger: follow them instead of the outline")
                              ->option_text("FILE")
                              ->excludes(window);
    app.add_option("--sigma", marker_.sigma,
                   "deviation of a marker point per axis, px, of its pixel and its place as it is seen "
                   "together, where "
                   "the CSV has none (1)")
        ->option_text("PX")
        ->check(CLI::Range(1e-3, 1e3))
        ->needs(marker);
    app.add_flag("--hold-rotation", marker_.options.hold_rotation,
                 "the finger turns as the scene's path says, however many points there are")
        ->needs(marker);
    app.add_flag(
           "--depth-of-scene", marker_.options.depth_of_scene,
           "keep the centre's depth along the camera's axis, and the rotation, as the scene's path says")
        ->needs(marker);
    add_clip_option(app, clip_);
  }

  ExitCode run(VerbContext& context) override {
    const ChosenView chosen = chosen_view(fitting::load_case(context.options.file, context.options.settings),
                                          clip_, context.options.output);
    const fitting::Case& c = chosen.of_view;
    const std::string& folder = chosen.folder;
    const bool by_marker = !marker_.file.empty();
    const Scene scene = load_scene(c.scene, c.scene_settings);
    const ColliderScene& collider = chosen_collider(scene, c.scene, collider_, !by_marker);
    if (c.camera.empty() && !fs::exists(fitting::camera_path(c, folder)))
      throw InputError(c.file + ": /camera", "nothing",
                       "a camera file, or one beside rendered footage in " + folder);
    const std::string footage = fitting::footage_path(c, folder);
    if (!fs::exists(footage) && footage.find_first_of("%*") == std::string::npos)
      throw InputError(footage, "no file", "footage (of a camera, or made by 'rhytid render')");
    fitting::FrameSourceOptions options;
    options.path = footage;
    options.last = scene.time.frames;
    fitting::FrameSource source(options);
    marker_.track = c.track;
    marker_.options.floor = c.fit.min_sigma;
    marker_.options.huber = c.fit.robust_scale;
    std::vector<fitting::Landmark> marker;
    const fitting::Camera camera = fitting::read_camera(fitting::case_camera_file(c, folder));
    if (by_marker) marker = read_marker_in(marker_, camera);
    (void)context.output_folder();
    if (source.size() != cv::Size(camera.width, camera.height))
      throw InputError(
          footage, std::to_string(source.size().width) + " x " + std::to_string(source.size().height) + " px",
          "the size of the camera, " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
              " px");
    cv::setNumThreads(context.options.threads);
    if (!c.fit.still.empty())
      context.progress.warning(
          "the path is in the frame of the camera: what the head moves is not taken out");

    Found found;
    found.frames = frames_of_scene(scene, collider);
    found.turns = std::any_of(collider.path.begin(), collider.path.end(),
                              [](const PathKnot& k) { return !k.rotation.isZero(0); });
    if (by_marker ? !follow_marker(source, marker, camera, collider, folder, context.progress, found)
                  : !follow_outline(source, camera, collider, context.progress, found))
      return ExitCode::interrupted;
    if (static_cast<int>(found.frames.size()) <= scene.time.frames)
      context.progress.warning(footage + " has " + counted(static_cast<long>(found.frames.size()), "frame") +
                               ", the scene " + std::to_string(scene.time.frames + 1) +
                               ": after the last one the path stays where it is");
    return write(found, collider, folder, context);
  }

 private:
  /// What comes of either way.
  struct Found {
    std::vector<FingerFrame> frames;
    std::vector<cv::Mat> pictures;
    bool turns = false;
    nlohmann::ordered_json record;
    std::vector<std::string> doubts;
    std::string words;  ///< what the deviations rest on
  };

  /// False when interrupted. Throws InputError for footage without a frame.
  bool follow_outline(fitting::FrameSource& source, const fitting::Camera& camera,
                      const ColliderScene& collider, Progress& progress, Found& found) const {
    const int asked = std::min<int>(source.frames_asked(), static_cast<int>(found.frames.size()));
    progress.stage("finger", asked);
    Vec3 correction = Vec3::Zero();  // of the scene's path: what the frame before needed, mm
    std::vector<FingerFrame> frames;
    while (std::optional<fitting::Frame> picture = source.next()) {
      FingerFrame& frame = frames.emplace_back(found.frames[static_cast<std::size_t>(picture->index)]);
      const fitting::OutlineEstimate outline = fitting::find_sphere(
          picture->colour, camera, frame.of_scene.centre + correction, collider.radius, {.window = window_});
      frame.lost = outline.lost;
      frame.found.centre = outline.centre;
      // Which part of it all frames share, pictures do not tell (a radius, the shade of a finger's rim): as much as
      // they err by themselves, since that is what was found of known paths.
      frame.covariance = frame.own = frame.shared = outline.covariance;
      frame.across_sigma = outline.across_sigma;
      frame.depth_sigma = outline.depth_sigma;
      frame.rms = outline.rms;
      frame.more = {{"samples", outline.samples}, {"used", outline.used}};
      for (const fitting::OutlineEdge& edge : outline.edges)
        frame.signs.push_back({edge.pixel, edge.weight > 0.05});
      if (frame.lost.empty())
        correction = frame.found.centre - frame.of_scene.centre;
      else
        progress.warning("frame " + std::to_string(frame.index) + " is lost: " + frame.lost);
      if (is_shown(frame.index, found.pictures.size(), asked))
        found.pictures.push_back(drawn_finger(picture->colour, frame, camera, collider));
      progress.step_done(static_cast<int>(frames.size()));
      if (progress.interrupted()) return false;
    }
    if (frames.empty()) throw InputError(source.options().path, "no frame", "a readable video or stills");
    found.frames = std::move(frames);
    found.record = {{"radius_mm", collider.radius}};
    found.words = "for a radius of exactly " + short_text(collider.radius) + " mm";
    return true;
  }

  /// The same.
  bool follow_marker(fitting::FrameSource& source, const std::vector<fitting::Landmark>& marker,
                     const fitting::Camera& camera, const ColliderScene& collider, const std::string& folder,
                     Progress& progress, Found& found) const {
    MarkerFinding finding = find_by_marker(marker_, marker, source, camera, found.frames, progress);
    if (finding.interrupted) return false;
    found.frames = std::move(finding.frames);
    found.turns = found.turns || finding.turns;
    found.record = std::move(finding.record);
    found.doubts = std::move(finding.doubts);
    found.words =
        "of it from frame to frame up to " + short_text(finding.own_sigma, 2) + " mm in any direction" +
        (finding.turns ? "; its turning was found too" : "; it turns as in the scene") +
        (marker_.options.depth_of_scene ? ", and has the scene's depth, whose error is not stated" : "");
    fitting::write_tracks(finding.tracks, (fs::path(folder) / "finger_tracks.csv").string());
    fitting::FrameSource again(source.options());
    const auto count = static_cast<int>(found.frames.size());
    while (std::optional<fitting::Frame> picture = again.next()) {
      if (picture->index >= count || found.pictures.size() == 4) break;
      if (is_shown(picture->index, found.pictures.size(), count))
        found.pictures.push_back(drawn_finger(
            picture->colour, found.frames[static_cast<std::size_t>(picture->index)], camera, collider));
    }
    return true;
  }

  static ExitCode write(const Found& found, const ColliderScene& collider, const std::string& folder,
                        VerbContext& context) {
    const auto in = [&folder](const char* name) { return (fs::path(folder) / name).string(); };
    const std::vector<FingerFrame>& frames = found.frames;
    const FingerSummary summary = summary_of(frames);
    const std::string png = tiled_png(found.pictures, folder), path = path_text(frames, found.turns);
    std::error_code ignored;
    fs::remove(in("finger.csv"), ignored);  // of an earlier run: it must not stand beside another's record
    write_file(in("finger.json"),
               finger_json(frames, collider, found.record)
                       .dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
                   "\n");
    write_file(in("finger.png"), png);
    if (path.empty()) {
      context.progress.warning(
          "the finger was found in no frame: no path is written (see finger.png: does the hand hide the tip, "
          "is "
          "the radius another, the scene's path too far off?)");
      return ExitCode::not_converged;
    }
    write_file(in("finger.csv"), path);
    context.out << in("finger.csv") << ": '" << collider.name << "' in " << summary.found << " of "
                << counted(static_cast<long>(frames.size()), "frame") << ", to "
                << short_text(summary.rms_px, 2) << " px rms\noff the scene's path by "
                << short_text(summary.off_rms, 3) << " mm rms, at most " << short_text(summary.off_largest, 3)
                << " mm; deviations up to " << short_text(summary.across_sigma, 2) << " mm across and "
                << short_text(summary.depth_sigma, 2) << " mm along the line of sight, " << found.words
                << "\nin the scene, in place of \"path\" of /colliders/" << collider.name
                << ": \"path_file\": \"finger.csv\" (from the scene's folder)\n";
    for (const std::string& doubt : found.doubts) context.progress.warning("doubtful path: " + doubt);
    const bool is_mostly_lost = 2 * summary.lost > static_cast<int>(frames.size());
    if (is_mostly_lost)
      context.progress.warning("doubtful path: " + std::to_string(summary.lost) + " of " +
                               counted(static_cast<long>(frames.size()), "frame") + " are lost");
    return is_mostly_lost || !found.doubts.empty() ? ExitCode::not_converged : ExitCode::ok;
  }

  std::string collider_, clip_;
  double window_ = 12;
  MarkerJob marker_;
};

}  // namespace

std::unique_ptr<Verb> make_verb_finger() {
  return std::make_unique<FingerVerb>();
}

}  // namespace rhytid::tools
