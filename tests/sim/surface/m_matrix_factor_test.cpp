#include "sim/surface/m_matrix_factor.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <set>

#include "sim/core/error.h"

namespace rhytid {
namespace {

TEST(MMatrixFactor, SolvesLikeADenseFactorisation) {
  std::mt19937 random(31);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int trial = 0; trial < 20; ++trial) {
    const int n = 5 + 6 * trial;
    const VectorXd slack = VectorXd::NullaryExpr(n, [&] { return uniform(random); });
    MatrixXd dense = slack.asDiagonal();
    std::vector<WeightedEdge> edges;
    std::set<std::pair<int, int>> used;
    for (int k = 0; k < 3 * n; ++k) {
      const int i = static_cast<int>(random() % static_cast<unsigned>(n));
      const int j = static_cast<int>(random() % static_cast<unsigned>(n));
      if (i == j || !used.insert({std::min(i, j), std::max(i, j)}).second) continue;
      edges.push_back({i, j, std::pow(10.0, 4 * uniform(random) - 2)});
      dense(i, i) += edges.back().weight, dense(j, j) += edges.back().weight;
      dense(i, j) -= edges.back().weight, dense(j, i) -= edges.back().weight;
    }
    const MatrixXd rhs = MatrixXd::Random(n, 3);
    const MatrixXd expected = dense.partialPivLu().solve(rhs);
    EXPECT_LT((MMatrixFactor(slack, edges).solve(rhs) - expected).norm(), 1e-11 * expected.norm());
  }
}

TEST(MMatrixFactor, EveryEntryOfADecayingSolutionHasItsDigits) {
  // A chain with slack m and weight w, right-hand side e₀: x_k = cosh((n − ½ − k) α) / (2 w sinh(n α)
  // sinh(α/2)), 2 cosh α = 2 + m/w. The last entries are 1e-290 of the first.
  const int n = 400;
  const double m = 1, w = 0.25;
  std::vector<WeightedEdge> edges;
  for (int i = 0; i + 1 < n; ++i) edges.push_back({i, i + 1, w});
  const VectorXd x = MMatrixFactor(VectorXd::Constant(n, m), edges).solve(VectorXd::Unit(n, 0));
  const long double alpha = std::acosh(1 + static_cast<long double>(m / w) / 2);
  for (int k = 0; k < n; ++k) {
    const long double exact =
        std::cosh((n - 0.5L - k) * alpha) / (2 * w * std::sinh(n * alpha) * std::sinh(alpha / 2));
    EXPECT_NEAR(static_cast<double>(x[k] / exact), 1, 1e-12) << k;
  }
  EXPECT_LT(x[n - 1], 1e-280);
}

TEST(MMatrixFactor, KeepsItsDigitsNextToSingular) {
  // Nearly no slack: x = (Σ rhs) / (Σ slack) at every node, whatever the weights.
  std::mt19937 random(32);
  std::uniform_real_distribution<double> uniform(1, 2);
  const int n = 300;
  std::vector<WeightedEdge> edges;
  for (int i = 0; i < n; ++i)
    for (const int step : {1, 17}) edges.push_back({i, (i + step) % n, uniform(random)});
  const VectorXd slack = VectorXd::Constant(n, 1e-40);
  const VectorXd x = MMatrixFactor(slack, edges).solve(VectorXd::Unit(n, 5));
  EXPECT_LT((x.array() * (1e-40 * n) - 1).abs().maxCoeff(), 1e-12);
}

TEST(MMatrixFactor, RefusesASingularMatrixAndLeavesEmptyRowsAtZero) {
  EXPECT_THROW(MMatrixFactor(VectorXd::Zero(2), {{0, 1, 1.0}}), ContractError);
  EXPECT_THROW(MMatrixFactor(VectorXd::Ones(2), {{0, 1, -1.0}}), ContractError);
  EXPECT_THROW(MMatrixFactor(VectorXd::Ones(2), {{0, 2, 1.0}}), ContractError);
  VectorXd slack = VectorXd::Ones(3);
  slack[2] = 0;
  const VectorXd x = MMatrixFactor(slack, {{0, 1, 1.0}}).solve(VectorXd::Ones(3));
  EXPECT_NEAR(x[0], 1, 1e-15);
  EXPECT_EQ(x[2], 0);
}

}  // namespace
}  // namespace rhytid
