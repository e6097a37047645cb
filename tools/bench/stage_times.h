// What one call of every stage of a step costs, at a state that a run has reached.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/scene/scene_model.h"

namespace rhytid::tools {

/// One stage: time of its fastest call and what that call handles.
struct StageTime {
  std::string name;
  double seconds = 0;     ///< on all threads
  double one_thread = 0;  ///< s, the same on one thread
  double calls = 0;       ///< per step of the run; 0 for what is part of another stage, or of no step
  double points = 0;      ///< quadrature points; 0 for a stage that has none
  double flops = 0;       ///< floating-point operations; 0 when not counted
  double bytes = 0;       ///< read at least; 0 when not counted
  /// A call on one thread alone whatever the number of threads: its limit is that of one.
  bool is_serial = false;
};

/// What this machine can do, measured now: the best of repeats.
struct MachineLimits {
  double fma_flops = 0;  ///< 1/s, of independent fused multiply-adds in the widest vectors; 0 without AVX2
  double fma_flops_avx2 = 0;  ///< 1/s, the same in vectors of AVX2
  double read_bandwidth = 0;  ///< bytes/s, reading an array far larger than the caches
};
/// By as many threads at once.
MachineLimits measure_machine_limits(int threads = 1);

struct StageReport {
  int nodes = 0, unknowns = 0, points = 0;
  double factor_entries = 0, factor_flops = 0;
  int steps = 0, iterations = 0;
  double run_seconds = 0;  ///< of the whole run, on all threads
  std::vector<StageTime> stages;
};

/// Runs `scene_model`, which has a frame at least, and times every stage of its last step over again: calls
/// repeated for at least `seconds` each, on one thread and on all in turn. Throws adjoint::GradientError when the run does not get there or the step cannot be
/// differentiated; nothing when `go_on` said false.
std::optional<StageReport> measure_stages(const SceneModel& scene_model, double seconds,
                                          const std::function<bool()>& go_on = {});

}  // namespace rhytid::tools
