#include "tools/polished_run.h"

#include "adjoint/certificate.h"
#include "tools/run_observer.h"

namespace rhytid::tools {

std::optional<Trajectory> polished_run(const SceneModel& scene_model, Progress& progress, ExitCode& code) {
  RunOptions options = scene_model.run_options();
  options.minimiser = adjoint::certificate_minimiser(options.minimiser);
  progress.stage("simulation", options.frames);
  const RunObserver observer = progress_observer(progress);
  Trajectory run = simulate(scene_model.model(), scene_model.native(), options, observer);
  progress.finish();
  if (run.complete) return run;
  if (progress.interrupted()) progress.note("interrupted; nothing is kept, the same command starts over");
  code = progress.interrupted() ? ExitCode::interrupted : ExitCode::not_converged;
  if (code == ExitCode::not_converged)
    progress.error("the run has no gradient, since it did not reach its last frame: " + run.failure);
  return std::nullopt;
}

}  // namespace rhytid::tools
