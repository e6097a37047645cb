// What `rhytid calibrate` says and writes of a calibration.
// Tests: tests/fitting/calibration_test.cpp
#pragma once

#include <string>

#include "fitting/calibration.h"

namespace rhytid::fitting {

/// The lens with its intervals, the photographs, why terms were left out, what is poor: for people.
std::string calibration_text(const Calibration& c);

/// The same for programs, JSON; names of files that are no UTF-8 have U+FFFD there.
std::string calibration_json(const Calibration& c);

/// Corner − projection of all corners over the picture, enlarged by a round factor, one colour a photograph;
/// parts of the picture without corners are shaded. A complete SVG.
std::string calibration_svg(const Calibration& c);

}  // namespace rhytid::fitting
