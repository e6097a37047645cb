// Ramp and hold of the Maxwell spring at dt/τ = 1/2 (B5): in a coaxial history its log strain follows
// e ← a e + b Δ, with a and b of each scheme; the exact ones are e^(−r) and (1 − e^(−r))/r.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sim/terms/skin_law.h"

namespace rhytid {
namespace {

TEST(MaxwellRamp, EverySchemeFollowsItsRecurrence) {
  const double tau = 2, dt = 1, r = dt / tau, alpha = std::exp(-r), step = 0.02;
  struct Row {
    const char* name;
    DamperScheme scheme;
    double a, b, stated;  ///< stated: after step 12, the checklist, B5; 0 = not there
  };
  const Row rows[] = {{"exponential", DamperScheme::exponential, alpha, (1 - alpha) / r, 0.03990085},
                      {"literal", DamperScheme::literal, alpha, alpha, 0.03075346},
                      {"strang", DamperScheme::strang, alpha, std::sqrt(alpha), 0},
                      {"backward_euler", DamperScheme::backward_euler, 1 / (1 + r), 1 / (1 + r), 0.03969171}};
  const double theta[5] = {0, 1, 1e-9, 1, tau};
  std::printf(
      "Maxwell log strain after 12 steps of ramp, after 8 more of hold; ratio to exact; worst error\n");
  for (const Row& row : rows) {
    const SkinLaw law{row.scheme};
    double history[6] = {}, y_old[6] = {}, expected = 0, worst = 0, exact = 0, at_end_of_ramp = 0;
    for (int i = 1; i <= 20; ++i) {
      const double total = step * std::min(i, 12), rate = i <= 12 ? step : 0;
      const double y[6] = {std::expm1(2 * total), std::expm1(-total), std::expm1(-total), 0, 0, 0};
      double prepared[6], next[6];
      law.prepare<double>(y_old, history, theta, nullptr, dt, prepared);
      law.update<double>(y, prepared, theta, nullptr, dt, next);
      std::copy(next, next + 6, history);
      std::copy(y, y + 6, y_old);
      expected = row.a * expected + row.b * rate;
      exact = alpha * exact + (1 - alpha) / r * rate;
      // The spring's own strain: ½ ln of C relative to C^v, along the axis.
      const double own = 0.5 * (std::log1p(y[0]) - std::log1p(history[0]));
      worst = std::max(worst, std::fabs(own - expected));
      if (i == 12) {
        at_end_of_ramp = own;
        if (row.stated > 0) {
          EXPECT_NEAR(own, row.stated, 5e-9) << row.name;
        }
      }
    }
    std::printf("  %-15s %.8f %.8f, %.4f, %.1e\n", row.name, at_end_of_ramp, expected, expected / exact,
                worst);
    EXPECT_LT(worst, 1e-15) << row.name;
  }
}

}  // namespace
}  // namespace rhytid
