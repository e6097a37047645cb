// rhytid finger: the path of the finger from footage, by its outline.
#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

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
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;
using fitting::OutlineEstimate;

/// What one frame says.
struct FingerFrame {
  int index = 0;
  double time = 0;  ///< s, on the clock of the path
  BodyPose of_scene;
  OutlineEstimate found;
};

/// The sphere that is meant; the only collider, or the one named. Throws InputError for other shapes.
const ColliderScene& chosen_collider(const Scene& scene, const std::string& file, const std::string& name) {
  const ColliderScene* chosen = nullptr;
  std::string names;
  for (const ColliderScene& c : scene.colliders) {
    names += (names.empty() ? "" : ", ") + c.name;
    if (c.name == name || (name.empty() && scene.colliders.size() == 1)) chosen = &c;
  }
  if (scene.colliders.empty()) throw InputError(file + ": /colliders", "none", "a sphere: the finger");
  if (chosen == nullptr)
    throw InputError("--collider", name.empty() ? "nothing" : "'" + name + "'", "one of " + names);
  if (chosen->shape != ShapeKind::sphere)
    throw InputError(file + ": /colliders/" + chosen->name + "/shape", "'" + to_string(chosen->shape) + "'",
                     "a sphere: the outline of another shape also depends on how it is turned");
  return *chosen;
}

void draw_outline(cv::Mat& picture, const fitting::Camera& camera, const Vec3& centre, double radius,
                  const cv::Scalar& colour) {
  constexpr int kShift = 4;  // OpenCV draws at 1/16 px
  std::vector<cv::Point> corners;
  for (const fitting::OutlinePoint& p : fitting::sphere_outline(centre, radius, camera, 180))
    corners.emplace_back(cvRound(16 * std::clamp(p.pixel.x(), -1e4, 1e5)),
                         cvRound(16 * std::clamp(p.pixel.y(), -1e4, 1e5)));
  if (!corners.empty()) cv::polylines(picture, corners, true, colour, 1, cv::LINE_AA, kShift);
}

/// Blue: the scene's path; green: what was found; dots: edges that fit, red ones that do not.
cv::Mat drawn(const cv::Mat& colour, const FingerFrame& frame, const fitting::Camera& camera, double radius) {
  cv::Mat picture = colour.clone();
  draw_outline(picture, camera, frame.of_scene.centre, radius, {230, 120, 40});
  if (frame.found.lost.empty()) draw_outline(picture, camera, frame.found.centre, radius, {60, 220, 60});
  for (const fitting::OutlineEdge& edge : frame.found.edges)
    cv::circle(picture, {cvRound(edge.pixel.x()), cvRound(edge.pixel.y())}, std::max(1, picture.cols / 400),
               edge.weight > 0.05 ? cv::Scalar(60, 220, 60) : cv::Scalar(40, 40, 230), cv::FILLED,
               cv::LINE_AA);
  const std::string text =
      "frame " + std::to_string(frame.index) + (frame.found.lost.empty() ? "" : ": lost");
  for (const int width : {3, 1})
    cv::putText(picture, text, {8, picture.rows - 10}, cv::FONT_HERSHEY_SIMPLEX,
                std::max(0.5, picture.cols / 1200.0), width == 3 ? cv::Scalar::all(0) : cv::Scalar::all(255),
                width, cv::LINE_AA);
  return picture;
}

/// Pictures of one size, two beside each other.
cv::Mat tiled(std::vector<cv::Mat> pictures) {
  if (pictures.size() % 2 == 1 && pictures.size() > 1)
    pictures.push_back(cv::Mat::zeros(pictures.front().size(), pictures.front().type()));
  if (pictures.size() == 1) return pictures.front();
  std::vector<cv::Mat> rows;
  for (std::size_t i = 0; i + 1 < pictures.size(); i += 2) {
    cv::Mat row;
    cv::hconcat(pictures[i], pictures[i + 1], row);
    rows.push_back(row);
  }
  cv::Mat all;
  cv::vconcat(rows, all);
  return all;
}

/// As `path_file` reads it; how the body turns stays as in the scene. Empty when all frames are lost.
std::string path_text(const std::vector<FingerFrame>& frames, bool turns) {
  std::string text;
  for (const FingerFrame& f : frames) {
    if (!f.found.lost.empty()) continue;
    text += exact_text(f.time);
    for (int k = 0; k < 3; ++k) text += "," + exact_text(f.found.centre[k]);
    if (turns) {
      const Eigen::Quaterniond q(f.of_scene.rotation);
      for (const double part : {q.w(), q.x(), q.y(), q.z()}) text += "," + exact_text(part);
    }
    text += "\n";
  }
  if (text.empty()) return text;
  return (turns ? "time,x,y,z,qw,qx,qy,qz\n" : "time,x,y,z\n") + text;
}

struct Distance {
  double rms = 0, largest = 0;  ///< mm from the scene's path
  double rms_px = 0, across_sigma = 0, depth_sigma = 0;
  int found = 0, lost = 0;
};

Distance distance_of(const std::vector<FingerFrame>& frames) {
  Distance d;
  for (const FingerFrame& f : frames) {
    if (!f.found.lost.empty()) {
      ++d.lost;
      continue;
    }
    ++d.found;
    const double off = (f.found.centre - f.of_scene.centre).norm();
    d.rms += off * off;
    d.largest = std::max(d.largest, off);
    d.rms_px += f.found.rms * f.found.rms;
    d.across_sigma = std::max(d.across_sigma, f.found.across_sigma);
    d.depth_sigma = std::max(d.depth_sigma, f.found.depth_sigma);
  }
  const double n = std::max(1, d.found);
  d.rms = std::sqrt(d.rms / n);
  d.rms_px = std::sqrt(d.rms_px / n);
  return d;
}

nlohmann::ordered_json finger_json(const std::vector<FingerFrame>& frames, const ColliderScene& collider,
                                   const Distance& distance) {
  using nlohmann::ordered_json;
  const auto list = [](const Vec3& v) { return ordered_json{v[0], v[1], v[2]}; };
  ordered_json rows = ordered_json::array();
  for (const FingerFrame& f : frames) {
    ordered_json& row = rows.emplace_back(ordered_json{{"frame", f.index},
                                                       {"time_s", f.time},
                                                       {"scene_mm", list(f.of_scene.centre)},
                                                       {"lost", !f.found.lost.empty()}});
    row["samples"] = f.found.samples;
    row["used"] = f.found.used;
    if (!f.found.lost.empty()) {
      row["why"] = f.found.lost;
      continue;
    }
    row["centre_mm"] = list(f.found.centre);
    row["sigma_mm"] = list(f.found.covariance.diagonal().cwiseSqrt());
    row["across_sigma_mm"] = f.found.across_sigma;
    row["depth_sigma_mm"] = f.found.depth_sigma;
    row["rms_px"] = f.found.rms;
  }
  return {{"collider", collider.name},        {"radius_mm", collider.radius},         {"lost", distance.lost},
          {"off_scene_rms_mm", distance.rms}, {"off_scene_max_mm", distance.largest}, {"frames", rows}};
}

class FingerVerb final : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "finger",
        "the path of the finger from footage, by its outline",
        "Follows the outline of a spherical collider through the footage and writes where its centre was in "
        "every frame, as a path for the scene. The search starts each frame at the scene's path, corrected "
        "by "
        "what the frame before needed, so that path need be right to some px only (--window). The radius "
        "must "
        "be right: one per cent of radius is one per cent of the distance to the camera. Along the line of "
        "sight "
        "the centre is known worst. Parts of the outline that are hidden are left out; a frame with less "
        "than a "
        "third of it is lost. Exit 3 when more than half of the frames are.",
        "case.json with its footage, camera and scene",
        "finger.csv (for /colliders/NAME/path_file), finger.json (deviations, edges used), finger.png (four "
        "frames: blue the scene's outline, green the one found). Prints how far it is from the scene's path",
        "rhytid finger case.json -o run/finger"};
  }
  bool takes_case() const override { return true; }
  void add_options(CLI::App& app) override {
    app.add_option("--collider", collider_, "which collider of the scene (default: the only one)")
        ->option_text("NAME");
    app.add_option("--window", window_, "how far from where it is expected an edge is looked for, px (12)")
        ->option_text("PX")
        ->check(CLI::Range(4.0, 60.0));
    add_clip_option(app, clip_);
  }

  ExitCode run(VerbContext& context) override {
    const ChosenView chosen = chosen_view(fitting::load_case(context.options.file, context.options.settings),
                                          clip_, context.options.output);
    const fitting::Case& c = chosen.of_view;
    const std::string& folder = chosen.folder;
    const Scene scene = load_scene(c.scene, c.scene_settings);
    const ColliderScene& collider = chosen_collider(scene, c.scene, collider_);
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
    (void)context.output_folder();
    const fitting::Camera camera = fitting::read_camera(fitting::case_camera_file(c, folder));
    if (source.size() != cv::Size(camera.width, camera.height))
      throw InputError(
          footage, std::to_string(source.size().width) + " x " + std::to_string(source.size().height) + " px",
          "the size of the camera, " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
              " px");
    cv::setNumThreads(context.options.threads);
    if (!c.fit.still.empty())
      context.progress.warning(
          "the path is in the frame of the camera: what the head moves is not taken out");

    std::vector<cv::Mat> pictures;
    std::vector<FingerFrame> frames;
    if (!follow(source, camera, scene, collider, context.progress, frames, pictures))
      return ExitCode::interrupted;
    return write(frames, pictures, collider, folder, context);
  }

 private:
  /// False when interrupted. Throws InputError for footage without a frame.
  bool follow(fitting::FrameSource& source, const fitting::Camera& camera, const Scene& scene,
              const ColliderScene& collider, Progress& progress, std::vector<FingerFrame>& frames,
              std::vector<cv::Mat>& pictures) const {
    const ColliderMotion motion(collider, scene.time.offset);
    const int asked = std::min(source.frames_asked(), scene.time.frames + 1);
    progress.stage("finger", asked);
    Vec3 correction = Vec3::Zero();  // of the scene's path: what the frame before needed, mm
    while (std::optional<fitting::Frame> picture = source.next()) {
      FingerFrame frame;
      frame.index = picture->index;
      const double time = frame.index / scene.time.frame_rate;
      frame.time = time + scene.time.offset;
      frame.of_scene = motion.at(time);
      frame.found = fitting::find_sphere(picture->colour, camera, frame.of_scene.centre + correction,
                                         collider.radius, {.window = window_});
      if (frame.found.lost.empty())
        correction = frame.found.centre - frame.of_scene.centre;
      else
        progress.warning("frame " + std::to_string(frame.index) + " is lost: " + frame.found.lost);
      const int shown = static_cast<int>(pictures.size());
      if (shown < 4 && frame.index >= shown * (asked - 1) / 3)
        pictures.push_back(drawn(picture->colour, frame, camera, collider.radius));
      frames.push_back(std::move(frame));
      progress.step_done(static_cast<int>(frames.size()));
      if (progress.interrupted()) return false;
    }
    if (frames.empty()) throw InputError(source.options().path, "no frame", "a readable video or stills");
    if (static_cast<int>(frames.size()) <= scene.time.frames)
      progress.warning(source.options().path + " has " + counted(static_cast<long>(frames.size()), "frame") +
                       ", the scene " + std::to_string(scene.time.frames + 1) +
                       ": after the last one the path stays where it is");
    return true;
  }

  static ExitCode write(const std::vector<FingerFrame>& frames, const std::vector<cv::Mat>& pictures,
                        const ColliderScene& collider, const std::string& folder, VerbContext& context) {
    const auto in = [&folder](const char* name) { return (fs::path(folder) / name).string(); };
    const bool turns = std::any_of(collider.path.begin(), collider.path.end(),
                                   [](const PathKnot& k) { return !k.rotation.isZero(0); });
    const Distance distance = distance_of(frames);
    std::vector<unsigned char> png;
    if (!cv::imencode(".png", tiled(pictures), png))
      throw InputError(folder, "no picture", "a picture that can be written");
    const std::string path = path_text(frames, turns);
    std::error_code ignored;
    fs::remove(in("finger.csv"), ignored);  // of an earlier run: it must not stand beside another's record
    write_file(in("finger.json"), finger_json(frames, collider, distance).dump(1) + "\n");
    write_file(in("finger.png"), std::string(png.begin(), png.end()));
    if (path.empty()) {
      context.progress.warning(
          "the finger was found in no frame: no path is written (see finger.png: does the hand hide the tip, "
          "is "
          "the radius another, the scene's path too far off?)");
      return ExitCode::not_converged;
    }
    write_file(in("finger.csv"), path);
    context.out << in("finger.csv") << ": '" << collider.name << "' in " << distance.found << " of "
                << counted(static_cast<long>(frames.size()), "frame") << ", outline to "
                << short_text(distance.rms_px, 2) << " px rms\noff the scene's path by "
                << short_text(distance.rms, 3) << " mm rms, at most " << short_text(distance.largest, 3)
                << " mm; deviations up to " << short_text(distance.across_sigma, 2) << " mm across and "
                << short_text(distance.depth_sigma, 2)
                << " mm along the line of sight, for a radius of exactly " << short_text(collider.radius)
                << " mm\nin the scene, in place of \"path\" of /colliders/" << collider.name
                << ": \"path_file\": \"finger.csv\" (from the scene's folder)\n";
    if (2 * distance.lost <= static_cast<int>(frames.size())) return ExitCode::ok;
    context.progress.warning("doubtful path: " + std::to_string(distance.lost) + " of " +
                             counted(static_cast<long>(frames.size()), "frame") + " are lost");
    return ExitCode::not_converged;
  }

  std::string collider_, clip_;
  double window_ = 12;
};

}  // namespace

std::unique_ptr<Verb> make_verb_finger() {
  return std::make_unique<FingerVerb>();
}

}  // namespace rhytid::tools
