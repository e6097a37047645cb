// The cases of `bench stability`: one small scene and, per case, what is set to an extreme.
#pragma once

#include <string>
#include <vector>

namespace rhytid::tools {

/// What must come out; anything else is a failure of the simulator.
enum class StabilityDemand {
  converges,
  refused,  ///< by an InputError, before anything is run
  /// Physics has no answer, or none that a quasi-static step can promise: converged or a clear report, either
  /// is right.
  clear_outcome,
};

struct StabilityCase {
  std::string sweep, value;           ///< e.g. "Poisson's ratio", "0.4999"
  std::vector<std::string> settings;  ///< of the base scene, as --set takes them
  bool is_quick = false;              ///< part of the subset that the tests run
  StabilityDemand demand = StabilityDemand::converges;
};

/// A patch of 16 × 12 mm, soft 1.5 mm under film 0.15 mm, with every feature: ligaments from two sources, a
/// plane base, a finger that presses, sticks and slips. JSON.
std::string stability_scene();

const std::vector<StabilityCase>& stability_cases();

}  // namespace rhytid::tools
