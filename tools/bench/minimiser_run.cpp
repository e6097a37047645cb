#include "tools/bench/minimiser_run.h"

#include <algorithm>
#include <utility>

#include "sim/output/text.h"
#include "tools/bench/timing.h"
#include "tools/peak_memory.h"

namespace rhytid::tools {

MinimiserOptions minimiser_to_compare(Minimiser method, const MinimiserOptions& of_scene) {
  MinimiserOptions options = method == Minimiser::lbfgs_literal ? published_minimiser() : MinimiserOptions();
  options.method = method;
  options.relative_tolerance = of_scene.relative_tolerance;
  options.absolute_tolerance = of_scene.absolute_tolerance;
  options.max_iterations = 1000000;
  options.precision = of_scene.precision;
  return options;
}

MinimiserRun run_minimiser(const SceneModel& scene_model, const MinimiserOptions& minimiser, double limit,
                           const std::function<bool()>& go_on) {
  MinimiserRun result;
  RunOptions options = scene_model.run_options();
  options.minimiser = minimiser;
  options.max_bisections = 0;
  options.keep_states = false;
  int softened = 0;
  bool out_of_time = false;
  (void)take_peak_memory();
  const double start = cpu_seconds();
  double frame_start = start;
  long iterations_before = 0;
  RunObserver observer;
  observer.iteration = [&](int, double, int, double, double residual) {
    result.gradient = residual;
    out_of_time = out_of_time || cpu_seconds() - start > limit;
    return !out_of_time && go_on();
  };
  observer.step = [&](const StepEvent& event) {
    const MinimiserReport& report = event.record.report;
    result.iterations += report.iterations;
    result.evaluations += report.evaluations;
    result.factorisations += report.factorisations;
    result.failed_factorisations += report.failed_factorisations;
    result.gradient = report.residual;
    result.tolerance = report.tolerance;
    result.energy = report.energy;
    softened += event.record.softened ? 1 : 0;
    if (!event.frame_done || event.record.frame == 0) return;
    result.u.push_back(event.state.u);
    const double now = cpu_seconds();
    result.frame_seconds.push_back(now - std::exchange(frame_start, now));
    result.frame_iterations.push_back(result.iterations -
                                      std::exchange(iterations_before, result.iterations));
  };
  const Trajectory run = simulate(scene_model.model(), scene_model.native(), options, observer);
  result.seconds = cpu_seconds() - start;
  result.wall_seconds = run.seconds;
  result.peak_memory = take_peak_memory().value_or(0);
  result.complete = run.complete;
  result.frames = std::max(0, run.frames());
  if (out_of_time) {
    result.trouble =
        "stopped after " + short_text(limit) + " s in frame " + std::to_string(result.frames + 1);
  } else if (!run.complete) {
    result.trouble = run.failure;
  } else if (softened > 0) {
    result.trouble =
        std::to_string(softened) + (softened == 1 ? " step" : " steps") + " by softened contacts";
  }
  return result;
}

double largest_difference(const MinimiserRun& a, const MinimiserRun& b) {
  double largest = 0;
  for (std::size_t f = 0; f < std::min(a.u.size(), b.u.size()); ++f)
    largest = std::max(largest, (a.u[f] - b.u[f]).lpNorm<Eigen::Infinity>());
  return largest;
}

}  // namespace rhytid::tools
