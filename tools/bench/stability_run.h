// One case of `bench stability`: run, watched and judged.
#pragma once

#include <functional>
#include <string>

#include "tools/bench/stability_cases.h"

namespace rhytid::tools {

enum class StabilityOutcome {
  converged,
  refused,        ///< bad input, with a message
  not_converged,  ///< a report, with the state before the step kept
  time_limit,     ///< stopped while iterating
  broken,         ///< not finite, an exception, or a state that contradicts its report
};
const char* name(StabilityOutcome outcome);

struct StabilityResult {
  StabilityOutcome outcome = StabilityOutcome::broken;
  std::string message;                                                      ///< why not converged
  int frames = 0, steps = 0, bisections = 0, softened = 0, iterations = 0;  ///< bisections: deepest
  double smallest_jacobian = 1;                                             ///< over all steps and points
  double residual = 0;  ///< largest residual over tolerance of all steps; at most 1 when converged
  double largest_displacement = 0;  ///< mm
  double seconds = 0;
  bool as_demanded = false;
};

/// Whether a message tells its reader what happened. Refused: it names the key that was set and says "got ...,
/// expected ...". Not converged: it names frame, time, status, iterations and the residual against what was
/// wanted. Converged: nothing need be said. Otherwise false.
bool is_clear(const StabilityCase& one, StabilityOutcome outcome, const std::string& message);

/// What `check` warns of in a case and not in the base scene; empty when nothing. For cases that converged.
std::string stability_warnings(const StabilityCase& one);

/// Runs a case for at most `limit` seconds. Beside what the simulator reports, it recomputes: every state is
/// finite, J > 0 at all points, and the residual of every converged step, evaluated anew, is what was
/// reported.
StabilityResult run_stability_case(const StabilityCase& one, double limit,
                                   const std::function<bool()>& interrupted = {});

}  // namespace rhytid::tools
