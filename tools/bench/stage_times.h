// What one call of every stage of a step costs, at a state that a run has reached.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/scene/scene_model.h"

namespace rhytid::tools {

/// One stage: median time of one call and what that call handles.
struct StageTime {
  std::string name;
  double seconds = 0;
  double points = 0;  ///< quadrature points; 0 for a stage that has none
  double flops = 0;   ///< floating-point operations, on all threads; 0 when not counted
  double bytes = 0;   ///< read at least, by one thread; 0 when not counted
};

/// What this machine can do on one core, measured now.
struct MachineLimits {
  double fma_flops = 0;       ///< 1/s, of independent fused multiply-adds
  double read_bandwidth = 0;  ///< bytes/s, reading an array far larger than the caches
};
MachineLimits measure_machine_limits();

struct StageReport {
  int nodes = 0, unknowns = 0, points = 0;
  double factor_entries = 0, factor_flops = 0;
  std::vector<StageTime> stages;
};

/// Runs `scene_model`, which has a frame at least, and times every stage of its last step over again: calls
/// repeated for at least `seconds` each. Throws adjoint::GradientError when the run does not get there or the step cannot be
/// differentiated; nothing when `go_on` said false.
std::optional<StageReport> measure_stages(const SceneModel& scene_model, double seconds,
                                          const std::function<bool()>& go_on = {});

}  // namespace rhytid::tools
