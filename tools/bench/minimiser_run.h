// One run of a scene with one minimiser, bounded in time, and what it took.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/scene/scene_model.h"

namespace rhytid::tools {

/// The scene's tolerances with the settings of a minimiser: those of `MinimiserOptions` for ours, those of
/// published_minimiser() for lbfgs_literal; iterations are not limited, as time is.
MinimiserOptions minimiser_to_compare(Minimiser method, const MinimiserOptions& of_scene);

/// Counts are sums over the steps that were finished.
struct MinimiserRun {
  std::string trouble;  ///< in words why it ended early, or what had to help it; empty when nothing
  bool complete = false;
  int frames = 0;  ///< reached
  long iterations = 0, evaluations = 0, factorisations = 0, failed_factorisations = 0;
  double seconds = 0;                 ///< CPU, of all threads
  std::vector<double> frame_seconds;  ///< CPU, of frames 1, 2, ...; the first has what is set up once
  std::vector<long> frame_iterations;
  double wall_seconds = 0;
  double peak_memory = 0;   ///< of the process, MB
  double gradient = 0;      ///< |gradient| at the end of the last step, N; of one given up, where it was left
  double tolerance = 0;     ///< N, of the last finished step
  double energy = 0;        ///< incremental potential at the end of the last finished step, mJ
  std::vector<VectorXd> u;  ///< displacements at the end of frames 1, 2, ..., mm
};

/// Simulates without halving steps: a minimiser that does not converge shows. Stops after `limit` CPU seconds,
/// or when `go_on` says no.
MinimiserRun run_minimiser(const SceneModel& scene_model, const MinimiserOptions& minimiser, double limit,
                           const std::function<bool()>& go_on);

/// Largest difference of a displacement over the frames that both reached, mm; 0 when there is none.
double largest_difference(const MinimiserRun& a, const MinimiserRun& b);

}  // namespace rhytid::tools
