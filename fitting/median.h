// The median, as all of the fit's code means it. Tests: tests/fitting/fit_result_test.cpp
#pragma once

#include <algorithm>
#include <vector>

namespace rhytid::fitting {

/// The value in the middle, of an even number the upper of the two; 0 of none.
inline double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace rhytid::fitting
