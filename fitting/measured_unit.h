// In which unit FittedMeasurement has a quantity. Tests: tests/fitting/fit_result_test.cpp
#pragma once

#include <string_view>

namespace rhytid::fitting {

/// As measurements.h and wave_spectrum.h say.
inline const char* measured_unit(std::string_view quantity) {
  if (quantity.starts_with("force_")) return "N";
  if (quantity.starts_with("waves_amplitude")) return "px";
  return quantity.starts_with("waves_direction") ? "°" : "mm";
}

}  // namespace rhytid::fitting
