// Matrix functions where eigenvalues meet (T5): first divided differences of log and power to the
// last digit, and a tangent of the law that does not notice the gap.
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <cstdio>
#include <random>

#include "sim/core/types.h"
#include "sim/math/spectral3.h"
#include "sim/terms/skin_law.h"

namespace rhytid {
namespace {

/// f[a, b] of the code: the derivative of f(diag(a, b, 2)) along the off-diagonal.
double divided_difference(double a, double b, bool power) {
  Dual<1> y[6], out[6];
  y[0] = a - 1, y[1] = b - 1, y[2] = 1.0;
  y[3].d[0] = 1;
  if (power)
    power_one_plus(y, Dual<1>(0.37), out);
  else
    log_one_plus(y, out);
  return out[3].d[0];
}

/// The same in 80 bit: a − b is exact, so that log1p and expm1 lose nothing.
long double exact_difference(double a, double b, bool power) {
  const long double gap = static_cast<long double>(a) - b, log_ratio = std::log1p(gap / b);
  if (gap == 0)
    return power ? 0.37L * std::pow(static_cast<long double>(b), -0.63L) : 1 / static_cast<long double>(b);
  return power ? std::pow(static_cast<long double>(b), 0.37L) * std::expm1(0.37L * log_ratio) / gap
               : log_ratio / gap;
}

TEST(MatrixFunctions, DividedDifferencesKeepTheirDigitsAtEveryGap) {
  std::printf("gap: error of log, power, of the quotient of logarithms [units of the last place]\n");
  double worst = 0;
  for (int k = 0; k <= 17; ++k) {
    const double b = 1.7, a = k == 17 ? b : b * (1 + std::pow(10.0, -k));
    const auto ulps = [&](double value, long double exact) {
      return static_cast<double>(std::fabs(value - exact) / exact) / std::numeric_limits<double>::epsilon();
    };
    const double log_error = ulps(divided_difference(a, b, false), exact_difference(a, b, false)),
                 power_error = ulps(divided_difference(a, b, true), exact_difference(a, b, true)),
                 packed = ulps(log_difference(a, b, std::log(a), std::log(b)), exact_difference(a, b, false)),
                 naive =
                     a == b ? 0 : ulps((std::log(a) - std::log(b)) / (a - b), exact_difference(a, b, false));
    if (k % 4 == 0 || k == 17)
      std::printf("  %.0e: %.1f %.1f %.1f, naive %.1e\n", a == b ? 0.0 : a / b - 1, log_error, power_error,
                  packed, naive);
    worst = std::max({worst, log_error, power_error, packed});
  }
  EXPECT_LT(worst, 6);
}

/// σ's tangent [6][6] at F = Q diag(stretches) Qᵀ with a history of the same axes.
Eigen::Matrix<double, 6, 6> tangent(const Mat3& axes, const Vec3& stretches, const Vec3& history) {
  const Mat3 c = axes * stretches.cwiseAbs2().asDiagonal() * axes.transpose(),
             v = axes * history.asDiagonal() * axes.transpose();
  Dual<6> y[6], prepared[6], sigma[6];
  const Dual<6> theta[5] = {0.2, 1.3, 30, 0.8, 0.09};
  for (int k = 0; k < 6; ++k) {
    y[k] = c(kSymRow[k], kSymCol[k]) - (k < 3);
    y[k].d[k] = 1;
    prepared[k] = v(kSymRow[k], kSymCol[k]) - (k < 3);
  }
  SkinLaw{}.stress<Dual<6>>(y, prepared, theta, nullptr, 0.04, sigma);
  Eigen::Matrix<double, 6, 6> t;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) t(i, j) = sigma[i].d[j];
  return t;
}

// As two stretches approach each other the tangent approaches that of equal ones at first order, down to
// rounding: an eigenvector differentiated anywhere, or a naive quotient, would blow up as 1e-16/gap.
TEST(MatrixFunctions, TheTangentDoesNotNoticeTheGap) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double worst_rate = 0, least_rate = 1e300, floor = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Mat3 axes =
        Eigen::HouseholderQR<Mat3>(Mat3::NullaryExpr([&] { return normal(random); })).householderQ();
    const double third = trial % 2 ? 1.2 : 0.7;  // every second time all three meet
    const Vec3 history(1.1, 1.1, 1 / 1.21);
    const auto at = [&](double gap) {
      return tangent(axes, Vec3(1.2, 1.2 * (1 + gap), third * (1 - gap)), history);
    };
    const Eigen::Matrix<double, 6, 6> equal = at(0);
    ASSERT_TRUE(equal.allFinite());
    for (int k = 3; k <= 16; ++k) {
      const double gap = std::pow(10.0, -k), change = (at(gap) - equal).norm() / equal.norm();
      if (k <= 9) {
        worst_rate = std::max(worst_rate, change / gap);
        least_rate = std::min(least_rate, change / gap);
      } else if (k >= 15) {
        floor = std::max(floor, change);
      }
    }
  }
  std::printf("tangent near equal stretches: change / gap %.2f .. %.2f for gaps 1e-3..1e-9, floor %.1e\n",
              least_rate, worst_rate, floor);
  EXPECT_LT(worst_rate, 2 * least_rate + 20);
  EXPECT_LT(floor, 3e-14);
}

}  // namespace
}  // namespace rhytid
