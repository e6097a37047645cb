// Difference quotients judged by their order: the error of a right derivative falls fourfold when the step
// halves.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <sstream>

#include "sim/core/types.h"

namespace rhytid::test {

/// Central differences of f along a direction (f takes the signed step) against `exact`. Passes when the
/// error falls fourfold per halving of `step`, or is round-off already: below `floor` · (|f|/step + |exact|).
inline ::testing::AssertionResult derivative_converges(const std::function<VectorXd(double)>& f,
                                                       const VectorXd& exact, double step,
                                                       double floor = 1e-12) {
  if (!exact.allFinite()) return ::testing::AssertionFailure() << "derivative not finite";
  std::ostringstream log;
  double previous = 0, smallest_relative = 1e300;
  bool seen_order = false;
  for (int k = 0; k < 9; ++k, step /= 2) {
    const VectorXd up = f(step), down = f(-step);
    const double error = ((up - down) / (2 * step) - exact).norm();
    const double round_off = floor * (up.norm() / step + exact.norm());
    log << "  step " << step << " error " << error << " of " << exact.norm() << '\n';
    if (!std::isfinite(error)) return ::testing::AssertionFailure() << "not finite\n" << log.str();
    if (error <= round_off) return ::testing::AssertionSuccess();
    if (previous > 0) {
      const double order = std::log2(previous / error);
      seen_order = order > 1.9 && order < 2.1;
    }
    smallest_relative = std::min(smallest_relative, error / std::max(exact.norm(), 1e-300));
    if (seen_order && k >= 3 && smallest_relative < 1e-3) return ::testing::AssertionSuccess();
    previous = error;
  }
  return ::testing::AssertionFailure() << "difference quotients do not converge at second order\n"
                                       << log.str();
}

}  // namespace rhytid::test
