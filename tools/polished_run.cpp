#include "tools/polished_run.h"

#include "adjoint/certificate.h"

namespace rhytid::tools {

std::optional<Trajectory> polished_run(const SceneModel& scene_model, Progress& progress, ExitCode& code) {
  RunOptions options = scene_model.run_options();
  options.minimiser = adjoint::certificate_minimiser(options.minimiser);
  progress.stage("simulation", options.frames);
  RunObserver observer;
  observer.iteration = [&](int, double, int iteration, double, double residual) {
    progress.iteration(iteration, residual);
    return !progress.interrupted();
  };
  observer.step = [&](const StepEvent& event) {
    if (event.frame_done && event.record.frame > 0) progress.step_done(event.record.frame);
  };
  Trajectory run = simulate(scene_model.model(), scene_model.native(), options, observer);
  progress.finish();
  if (run.complete) return run;
  code = progress.interrupted() ? ExitCode::interrupted : ExitCode::not_converged;
  if (code == ExitCode::not_converged)
    progress.error("the run has no gradient, since it did not reach its last frame: " + run.failure);
  return std::nullopt;
}

}  // namespace rhytid::tools
