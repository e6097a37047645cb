// track.json: what the tracker did, in numbers.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "fitting/tracking/there_and_back.h"
#include "fitting/tracking/tracker.h"
#include "tools/render/tracking_error.h"

namespace rhytid::tools {

nlohmann::json track_record(const fitting::TrackerReport& report,
                            const std::optional<fitting::ThereAndBack>& returned,
                            const std::optional<TrackingError>& against_truth);

}  // namespace rhytid::tools
