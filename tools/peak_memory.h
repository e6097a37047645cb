// How much memory the process had resident at most.
#pragma once

#include <optional>

namespace rhytid::tools {

/// Peak since the last call, or since the start, in 10⁶ bytes; and counting starts anew. Nothing where the
/// system does not tell, or does not let the count be reset (then it is the peak of the whole run from the
/// second call on).
std::optional<double> take_peak_memory();

}  // namespace rhytid::tools
