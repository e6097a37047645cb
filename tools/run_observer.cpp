#include "tools/run_observer.h"

namespace rhytid::tools {

RunObserver progress_observer(Progress& progress) {
  RunObserver observer;
  observer.iteration = [&progress](int, double, int iteration, double, double residual) {
    progress.iteration(iteration, residual);
    return !progress.interrupted();
  };
  observer.step = [&progress](const StepEvent& event) {
    if (event.frame_done && event.record.frame > 0) progress.step_done(event.record.frame);
  };
  return observer;
}

}  // namespace rhytid::tools
