#include "tools/render/twin_run.h"

#include <cmath>
#include <filesystem>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/time/model_digest.h"
#include "tools/run_observer.h"

namespace rhytid::tools {

Scene truth_scene(const fitting::Case& c) {
  return c.truth_scene.empty() ? load_scene(c.scene, c.scene_settings)
                               : load_scene(c.truth_scene, c.truth_settings);
}

int frame_stride(const Scene& fit, const Scene& truth) {
  const double ratio = truth.time.frame_rate / fit.time.frame_rate, stride = std::round(ratio);
  if (stride < 1 || std::abs(ratio - stride) > 1e-9 * stride)
    throw InputError(
        truth.file + ": /time/frame_rate", std::to_string(truth.time.frame_rate) + " Hz",
        "an integer multiple of the fit's frame rate, " + std::to_string(fit.time.frame_rate) + " Hz");
  return static_cast<int>(stride);
}

std::string motion_identity(const SceneModel& truth) {
  return scene_to_json(truth.scene()).dump() + " contents " + content_digest(truth.model());
}

TwinRun run_twin(const SceneModel& truth, int stride, Progress& progress) {
  const Model& model = truth.model();
  TwinRun out;
  out.surface = outer_surface(model.mesh, motion_identity(truth));
  out.surface.times.push_back(0);
  out.surface.displacements.push_back(VectorXd::Zero(3 * model.mesh.num_columns));

  RunOptions options = truth.run_options();
  options.keep_states = false;
  progress.stage("simulate", options.frames);
  RunObserver observer = progress_observer(progress);
  observer.step = [&](const StepEvent& event) {
    if (!event.frame_done) return;
    progress.step_done(event.record.frame);
    if (event.record.frame % stride != 0) return;
    if (event.record.frame == 0) out.surface.times.clear(), out.surface.displacements.clear();
    out.surface.times.push_back(event.state.time);
    out.surface.displacements.push_back(outer_displacement(model.mesh, event.state.u));
  };
  const Trajectory run = simulate(model, truth.native(), options, observer);
  out.complete = run.complete, out.failure = run.failure, out.seconds = run.seconds;
  return out;
}

TwinRun kept_twin(const SceneModel& truth, int stride, const std::string& path, Progress& progress) {
  if (!std::filesystem::exists(path)) return run_twin(truth, stride, progress);
  TwinRun kept;
  kept.surface = read_motion(path);
  kept.complete = true;
  const int frames = truth.scene().time.frames / stride + 1;
  if (kept.surface.scene == motion_identity(truth) && kept.surface.frames() == frames) return kept;
  progress.note("truth_motion.bin is of another scene or incomplete; simulating again");
  return run_twin(truth, stride, progress);
}

}  // namespace rhytid::tools
