// The range of a parameter that a screening covers, as a unit interval of its log or logit coordinate.
// Tests: tests/tools/screen_test.cpp
#pragma once

#include <string>
#include <vector>

#include "sim/scene/parameter.h"

namespace rhytid::tools {

struct ParameterRange {
  ParameterSpec spec;
  double lower = 0, upper = 0;  ///< internal units
  /// The value at x in [0, 1]: evenly in ln p (log), in ln((p−l)/(u−p)) with the spec's bounds (logit), or in
  /// p.
  double at(double x) const;
};

/// p/factor to p·factor for log parameters, the same of the odds for logit ones, and p ± (1 − 1/factor)·(u − l)/2
/// for plain ones (places: wherever the origin is), cut to the bounds l, u of a fit; a value beyond these is not
/// cut away. Throws InputError unless factor > 1 and finite, or for a range without extent.
ParameterRange range_around(const ParameterSpec& spec, double factor);

/// A table "address, lower, upper", values with or without units. Throws InputError naming file and line: an
/// address that the scene has not, bounds that a scene may not hold or in the wrong order.
std::vector<ParameterRange> read_ranges(const std::string& path, const Scene& scene);

}  // namespace rhytid::tools
