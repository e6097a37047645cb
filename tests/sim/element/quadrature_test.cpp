#include "sim/element/quadrature.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sim/core/error.h"

namespace rhytid {
namespace {

TEST(GaussLegendre, IntegratesPowersToTwiceItsPoints) {
  for (int n = 1; n <= 16; ++n) {
    const auto points = gauss_legendre(n);
    ASSERT_EQ(static_cast<int>(points.size()), n);
    for (int a = 0; a < 2 * n; ++a) {
      long double sum = 0;
      for (const auto& [w, weight] : points) sum += weight * std::pow(static_cast<long double>(w), a);
      EXPECT_NEAR(static_cast<double>(sum), a % 2 ? 0. : 2. / (a + 1), 4e-16) << n << " points, w^" << a;
    }
    // The first degree that is missed has the error 2^(2n+1) (n!)^4 / ((2n+1) ((2n)!)²).
    double sum = 0;
    for (const auto& [w, weight] : points) sum += weight * std::pow(w, 2 * n);
    const double error =
        std::exp((2 * n + 1) * std::log(2.) + 4 * std::lgamma(n + 1.) - 2 * std::lgamma(2 * n + 1.)) /
        (2 * n + 1);
    EXPECT_NEAR(2. / (2 * n + 1) - sum, error, 1e-3 * error + 4e-16) << n;
  }
}

TEST(GaussLegendre, IsSymmetricAndRises) {
  for (int n = 1; n <= 16; ++n) {
    const auto points = gauss_legendre(n);
    for (int i = 0; i < n; ++i) {
      EXPECT_EQ(points[i].w, -points[n - 1 - i].w);
      EXPECT_EQ(points[i].weight, points[n - 1 - i].weight);
      EXPECT_GT(points[i].weight, 0);
      if (i > 0) {
        EXPECT_GT(points[i].w, points[i - 1].w);
      }
    }
  }
}

TEST(GaussLegendre, MatchesClosedForms) {
  EXPECT_DOUBLE_EQ(gauss_legendre(2)[1].w, 1 / std::sqrt(3.));
  EXPECT_DOUBLE_EQ(gauss_legendre(3)[2].w, std::sqrt(0.6));
  EXPECT_DOUBLE_EQ(gauss_legendre(3)[1].weight, 8. / 9);
  EXPECT_EQ(gauss_legendre(3)[1].w, 0);
  EXPECT_DOUBLE_EQ(gauss_legendre(5)[4].w, std::sqrt(5 + 2 * std::sqrt(10. / 7)) / 3);
  EXPECT_DOUBLE_EQ(gauss_legendre(5)[4].weight, (322 - 13 * std::sqrt(70.)) / 900);
}

TEST(GaussLegendre, RefusesOtherSizes) {
  EXPECT_THROW(gauss_legendre(0), ContractError);
  EXPECT_THROW(gauss_legendre(17), ContractError);
}

}  // namespace
}  // namespace rhytid
