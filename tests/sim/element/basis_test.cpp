#include "sim/element/basis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "sim/core/error.h"

namespace rhytid {
namespace {

std::vector<std::array<double, 2>> random_points(int count) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<std::array<double, 2>> points;
  while (static_cast<int>(points.size()) < count) {
    const double u = uniform(random), v = uniform(random);
    if (u + v <= 1) points.push_back({u, v});
  }
  return points;
}

class TriangleBasisOrder : public testing::TestWithParam<int> {};
class LineBasisOrder : public testing::TestWithParam<int> {};

TEST_P(TriangleBasisOrder, NodesAreOrderedCornersEdgesInterior) {
  const int p = GetParam();
  const TriangleBasis basis(p);
  ASSERT_EQ(basis.num_nodes(), (p + 1) * (p + 2) / 2);
  const std::array<std::array<int, 2>, 3> corners{{{0, 0}, {p, 0}, {0, p}}};
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(basis.lattice()[k], corners[k]);
    for (int m = 1; m < p; ++m) {
      const auto &a = corners[k], &b = corners[(k + 1) % 3];
      const std::array<int, 2> expected{a[0] + m * (b[0] - a[0]) / p, a[1] + m * (b[1] - a[1]) / p};
      EXPECT_EQ(basis.lattice()[3 + k * (p - 1) + m - 1], expected);
    }
  }
  if (p == 4) {
    EXPECT_EQ(basis.lattice()[12], (std::array<int, 2>{1, 1}));
    EXPECT_EQ(basis.lattice()[13], (std::array<int, 2>{2, 1}));
    EXPECT_EQ(basis.lattice()[14], (std::array<int, 2>{1, 2}));
  }
  EXPECT_EQ(std::set(basis.lattice().begin(), basis.lattice().end()).size(), basis.lattice().size());
}

TEST_P(TriangleBasisOrder, IsOneAtItsNodeAndZeroAtTheOthers) {
  const TriangleBasis basis(GetParam());
  std::vector<double> values(basis.num_nodes());
  for (int i = 0; i < basis.num_nodes(); ++i) {
    basis.evaluate(basis.nodes()[i][0], basis.nodes()[i][1], values.data(), nullptr, nullptr);
    for (int j = 0; j < basis.num_nodes(); ++j) EXPECT_NEAR(values[j], i == j, 1e-14) << i << " " << j;
  }
}

// u^a v^b with a + b ≤ p is interpolated exactly, in both derivatives too; a = b = 0: partition of unity.
TEST_P(TriangleBasisOrder, ReproducesPolynomialsAndTheirDerivatives) {
  const int p = GetParam();
  const TriangleBasis basis(p);
  const int n = basis.num_nodes();
  std::vector<double> values(n), by_u(n), by_v(n);
  for (const auto& [u, v] : random_points(20)) {
    basis.evaluate(u, v, values.data(), by_u.data(), by_v.data());
    for (int a = 0; a <= p; ++a) {
      for (int b = 0; a + b <= p; ++b) {
        double value = 0, slope_u = 0, slope_v = 0;
        for (int i = 0; i < n; ++i) {
          const double f = std::pow(basis.nodes()[i][0], a) * std::pow(basis.nodes()[i][1], b);
          value += values[i] * f;
          slope_u += by_u[i] * f;
          slope_v += by_v[i] * f;
        }
        EXPECT_NEAR(value, std::pow(u, a) * std::pow(v, b), 1e-14);
        EXPECT_NEAR(slope_u, a ? a * std::pow(u, a - 1) * std::pow(v, b) : 0, 2e-13);
        EXPECT_NEAR(slope_v, b ? b * std::pow(u, a) * std::pow(v, b - 1) : 0, 2e-13);
      }
    }
  }
}

// One degree higher must not be reproduced, or the test above proves nothing.
TEST_P(TriangleBasisOrder, DoesNotReproduceTheNextDegree) {
  const int p = GetParam();
  const TriangleBasis basis(p);
  std::vector<double> values(basis.num_nodes());
  basis.evaluate(0.31, 0.23, values.data(), nullptr, nullptr);
  double value = 0;
  for (int i = 0; i < basis.num_nodes(); ++i) value += values[i] * std::pow(basis.nodes()[i][0], p + 1);
  EXPECT_GT(std::abs(value - std::pow(0.31, p + 1)), 1e-4);
}

TEST_P(TriangleBasisOrder, SubtrianglesTileTheTriangleCounterClockwise) {
  const int p = GetParam();
  const TriangleBasis basis(p);
  ASSERT_EQ(static_cast<int>(basis.subtriangles().size()), p * p);
  for (const auto& [a, b, c] : basis.subtriangles()) {
    const auto &A = basis.lattice()[a], &B = basis.lattice()[b], &C = basis.lattice()[c];
    EXPECT_EQ((B[0] - A[0]) * (C[1] - A[1]) - (B[1] - A[1]) * (C[0] - A[0]), 1);
  }
}

TEST_P(LineBasisOrder, ReproducesPolynomialsAndIsNodal) {
  const int q = GetParam();
  const LineBasis basis(q);
  ASSERT_EQ(basis.num_nodes(), q + 1);
  EXPECT_EQ(basis.nodes().front(), -1);
  EXPECT_EQ(basis.nodes().back(), 1);
  std::vector<double> values(q + 1), slopes(q + 1);
  for (int i = 0; i <= q; ++i) {
    basis.evaluate(basis.nodes()[i], values.data(), nullptr);
    for (int j = 0; j <= q; ++j) EXPECT_NEAR(values[j], i == j, 1e-14);
  }
  for (const double w : {-1., -0.77, -0.2, 0., 0.41, 0.93, 1.}) {
    basis.evaluate(w, values.data(), slopes.data());
    for (int a = 0; a <= q; ++a) {
      double value = 0, slope = 0;
      for (int i = 0; i <= q; ++i) {
        value += values[i] * std::pow(basis.nodes()[i], a);
        slope += slopes[i] * std::pow(basis.nodes()[i], a);
      }
      EXPECT_NEAR(value, std::pow(w, a), 1e-14);
      EXPECT_NEAR(slope, a ? a * std::pow(w, a - 1) : 0, 1e-13);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Orders, TriangleBasisOrder, testing::Range(1, 5));
INSTANTIATE_TEST_SUITE_P(Orders, LineBasisOrder, testing::Range(1, 5));

TEST(Basis, RefusesOtherOrders) {
  EXPECT_THROW(TriangleBasis(0), ContractError);
  EXPECT_THROW(TriangleBasis(5), ContractError);
  EXPECT_THROW(LineBasis(0), ContractError);
  EXPECT_THROW(LineBasis(5), ContractError);
}

}  // namespace
}  // namespace rhytid
