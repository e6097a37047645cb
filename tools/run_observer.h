// What every run in the foreground does beside its own work: show where it is, and stop when the user says so.
#pragma once

#include "sim/time/simulate.h"
#include "tools/progress.h"

namespace rhytid::tools {

/// Shows iterations and finished frames on `progress`, which must outlive it, and stops once that is interrupted.
/// Whoever keeps frames replaces `step`.
RunObserver progress_observer(Progress& progress);

}  // namespace rhytid::tools
