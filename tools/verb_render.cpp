// rhytid render: a case's truth, simulated and filmed, with exact ground truth beside the footage.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <ostream>

#include "fitting/cameras.h"
#include "fitting/case.h"
#include "fitting/case_camera.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "sim/scene/load.h"
#include "tools/clip_argument.h"
#include "tools/footage_record.h"
#include "tools/render/exposure.h"
#include "tools/render/footage.h"
#include "tools/render/skin_camera.h"
#include "tools/render/skin_renderer.h"
#include "tools/render/truth.h"
#include "tools/render/twin_run.h"
#include "tools/share_check.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// Footage is always written into the folder, never over the file that a case names elsewhere.
std::string footage_in(const fitting::Case& c, const std::string& folder) {
  const fs::path named = fs::path(c.footage).filename();
  if (!named.empty()) return (fs::path(folder) / named).string();
  return (fs::path(folder) / (c.render.codec == "h264" ? "footage.mp4" : "footage.avi")).string();
}

/// Dots as `rhytid finger --marker` reads them, exact.
std::string marker_text(const Finger& finger, const fitting::Camera& camera, int count) {
  std::string text = "name,x_px,y_px,x_mm,y_mm,z_mm,sigma_px\n";
  int number = 0;
  for (const Vec3& dot : finger_dots(finger, camera, count)) {
    text += "dot" + std::to_string(++number);
    const Vec2 pixel = camera.project(finger.tip + finger.rotation * dot);
    for (const double value : {pixel.x(), pixel.y(), dot.x(), dot.y(), dot.z(), 0.05})
      text += "," + exact_text(value);
    text += "\n";
  }
  return text;
}

class Render : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "render",
        "simulate the truth of a case and film it",
        "Runs the truth's scene of a case (the fit's scene when it names none) and renders what a camera "
        "would "
        "see: textured skin, the finger, noise. Beside the footage stands the exact ground truth, so that "
        "tracking and fitting can be judged. Use it for twin experiments: can the parameters be found again?",
        "case.json, its scenes and camera",
        "footage.avi or .mp4, frame_*.png (first, middle, last), camera.yaml, truth_tracks.csv, truth.json, "
        "truth_motion.bin; with /render/finger_dots marker_NAME.csv, where the dots are",
        "rhytid render data/scenes/demo/case.json -o run/demo"};
  }
  bool takes_case() const override { return true; }
  void add_options(CLI::App& app) override {
    app.add_flag("--keep-motion", keep_motion_,
                 "film the truth_motion.bin that is in the folder, if it is of the same scene, instead of "
                 "simulating again");
    app.add_option(
           "--exposure", exposure_,
           "share of the frame interval that the shutter is open, about the frame's time: what moves is "
           "blurred (default: 0)")
        ->option_text("FRACTION")
        ->check(share_check());
    add_clip_option(app, clip_);
  }

  ExitCode run(VerbContext& context) override {
    const ChosenView chosen = chosen_view(fitting::load_case(context.options.file, context.options.settings),
                                          clip_, context.output_folder());
    const fitting::Case& c = chosen.of_view;
    const std::string& folder = chosen.folder;
    const Scene fit = load_scene(c.scene, c.scene_settings);
    const SceneModel truth(truth_scene(c));
    const int stride = frame_stride(fit, truth.scene());
    const auto in_folder = [&folder](const char* name) { return (fs::path(folder) / name).string(); };

    require_encoder(c, fit, folder);
    const TwinRun twin = keep_motion_
                             ? kept_twin(truth, stride, in_folder("truth_motion.bin"), context.progress)
                             : run_twin(truth, stride, context.progress);
    if (context.progress.interrupted()) return ExitCode::interrupted;
    // From here on what the folder holds of an earlier truth is wrong. Footage and camera of before stay
    // until the new footage is whole: an interrupted run leaves a pair that belongs together, or no camera.
    fs::remove(in_folder("truth.json"));
    fs::remove(in_folder("truth_tracks.csv"));
    write_motion(twin.surface, in_folder("truth_motion.bin"));
    const fitting::Camera camera =
        c.camera.empty() ? automatic_camera(twin.surface, c.render.width, c.render.height, c.render.tilt)
                         : fitting::read_case_camera(c);
    if (!film(context, c, truth.scene(), twin.surface, camera, exposure_, folder))
      return ExitCode::interrupted;
    write_markers(c, truth.scene(), twin.surface, camera, folder);
    nlohmann::json record = truth_record(fit, truth, stride, twin.surface.frames());
    record["footage"].update(footage_record(footage_in(c, folder)));
    record["footage"]["exposure"] = exposure_;
    write_file(in_folder("truth.json"), record.dump(2) + "\n");
    if (twin.complete) return ExitCode::ok;
    context.progress.error("the truth's run ended early: " + twin.failure);
    return ExitCode::not_converged;
  }

 private:
  /// A file for every finger that has dots; that of an earlier run goes.
  static void write_markers(const fitting::Case& c, const Scene& truth, const MovingSurface& surface,
                            const fitting::Camera& camera, const std::string& folder) {
    const std::vector<Finger> fingers = fingers_at(truth, 0, finger_direction(surface.mean_normal(), camera));
    std::size_t finger = 0;
    for (const ColliderScene& collider : truth.colliders) {
      if (collider.shape != ShapeKind::sphere) continue;
      const std::string path = (fs::path(folder) / ("marker_" + collider.name + ".csv")).string();
      const Finger& drawn = fingers[finger++];
      fs::remove(path);
      if (c.render.finger && c.render.finger_dots > 0)
        write_file(path, marker_text(drawn, camera, c.render.finger_dots));
    }
  }

  /// What cannot be encoded is refused before the truth is simulated, which may take hours.
  static void require_encoder(const fitting::Case& c, const Scene& fit, const std::string& folder) {
    int width = c.render.width, height = c.render.height;
    if (!c.camera.empty()) {
      const fitting::Camera camera = fitting::read_case_camera(c);
      width = camera.width, height = camera.height;
    }
    const FootageWriter opened(footage_in(c, folder), c.render.codec, fit.time.frame_rate, width, height);
  }

  /// False when interrupted.
  static bool film(VerbContext& context, const fitting::Case& c, const Scene& truth,
                   const MovingSurface& surface, const fitting::Camera& camera, double exposure,
                   const std::string& folder) {
    const SubdividedSurface tessellation(surface.mesh, SurfaceSide::outer,
                                         subdivision_for(surface, camera, 3));
    const int pictures = pictures_of_exposure(surface, camera, exposure);
    const MovingSurface exposed = exposed_surface(surface, exposure, pictures);
    const SkinRenderer renderer(exposed, tessellation, truth, camera, c.render);
    const Vec3 direction = finger_direction(surface.mean_normal(), camera);
    TruthTracker tracker(surface, tessellation, camera, c.render.truth_spacing);
    const std::string path = footage_in(c, folder);
    const int frames = surface.frames();
    const double rate = frames > 1 ? (frames - 1) / surface.times.back() : truth.time.frame_rate;
    FootageWriter footage(path, c.render.codec, rate, camera.width, camera.height);
    context.progress.stage("render", frames);
    double seconds = 0;
    for (int frame = 0; frame < frames; ++frame) {
      const auto begin = std::chrono::steady_clock::now();
      const Image image = sensor_picture(renderer.exposed_levels(frame * pictures, pictures), frame,
                                         c.render.noise, c.render.seed);
      seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      footage.add(image);
      if (frame == 0 || frame == frames / 2 || frame == frames - 1) {
        char name[32];
        std::snprintf(name, sizeof(name), "frame_%04d.png", frame);
        write_png((fs::path(folder) / name).string(), image);
      }
      const double time = surface.times[static_cast<size_t>(frame)];
      tracker.add_frame(frame, c.render.finger ? fingers_at(truth, time, direction) : std::vector<Finger>());
      context.progress.step_done(frame + 1);
      if (context.progress.interrupted()) return false;
    }
    const std::string camera_file = (fs::path(folder) / "camera.yaml").string();
    fs::remove(camera_file);
    footage.commit();
    fitting::write_camera(camera, camera_file);
    fitting::write_tracks(tracker.tracks(), (fs::path(folder) / "truth_tracks.csv").string());
    char text[160];
    std::snprintf(text, sizeof(text), "%d frames at %g Hz, %d x %d px, %.2f s a frame; %zu exact tracks",
                  frames, rate, camera.width, camera.height, seconds / frames, tracker.points().size());
    context.out << path << ": " << text << '\n';
    return true;
  }

  bool keep_motion_ = false;
  double exposure_ = 0;
  std::string clip_;
};

}  // namespace

std::unique_ptr<Verb> make_verb_render() {
  return std::make_unique<Render>();
}

}  // namespace rhytid::tools
