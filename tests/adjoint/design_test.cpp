// Posteriors and designs of experiments whose information is known in closed form.
#include "adjoint/design.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

MatrixXd row(double a, double b) {
  MatrixXd R(1, 2);
  R << a, b;
  return R;
}

TEST(Design, PosteriorOfIndependentMeasurementsIsTextbook) {
  // Prior 2 and 0.5; measured: the first with deviation 1/3, the second never.
  const VectorXd prior = Eigen::Vector2d(2, 0.5);
  const Posterior p = posterior({row(3, 0)}, {0}, prior);
  EXPECT_NEAR(p.covariance(0, 0), 1 / (0.25 + 9), 1e-15);
  EXPECT_NEAR(p.covariance(1, 1), 0.25, 1e-15);
  EXPECT_NEAR(p.covariance(0, 1), 0, 1e-15);
  EXPECT_NEAR(p.log_det, std::log(0.25 / 9.25), 1e-14);
  EXPECT_NEAR(p.trace, 0.25 + 1 / 9.25, 1e-15);
  EXPECT_NEAR(information_gain_bits(p, prior), 0.5 * std::log2(4 * 9.25), 1e-13);
  EXPECT_NEAR(information_gain_bits(posterior({}, {}, prior), prior), 0, 1e-14);
}

TEST(Design, PosteriorIsTheInverseOfTheSumOfInformation) {
  const std::vector<MatrixXd> roots = {row(1, 2), row(-3, 1)};
  const VectorXd prior = Eigen::Vector2d(1.5, 0.7);
  MatrixXd sum = prior.cwiseAbs2().cwiseInverse().asDiagonal();
  for (const int e : {0, 1, 1}) sum += roots[e].transpose() * roots[e];
  const Posterior p = posterior(roots, {0, 1, 1}, prior);
  EXPECT_NEAR((p.covariance - sum.inverse()).norm(), 0, 1e-14);
  EXPECT_NEAR(p.correlation()(0, 1), p.covariance(0, 1) / p.deviations()[0] / p.deviations()[1], 1e-14);
  EXPECT_EQ(p.correlation()(1, 1), 1);
}

// One experiment sees the sum, another the same sum a little better, the third the difference. The best
// single one is the second; beside it the third is worth more than the first.
const std::vector<MatrixXd> kThree = {row(10, 10), row(11, 11), row(4, -4)};

TEST(Design, TheBestPairIsOfExperimentsThatComplementEachOther) {
  const VectorXd prior = Eigen::Vector2d(1, 1);
  for (const DesignCriterion criterion : {DesignCriterion::d_optimality, DesignCriterion::a_optimality}) {
    SCOPED_TRACE(name(criterion));
    const auto plan = greedy_design(kThree, prior, criterion, {}, 5);
    ASSERT_EQ(plan.size(), 3u);
    EXPECT_EQ(plan[0].experiment, 1);
    EXPECT_EQ(plan[1].experiment, 2);
    EXPECT_EQ(plan[2].experiment, 0);
    EXPECT_LT(plan[1].value, plan[0].value);
    const auto pairs = ranked_pairs(kThree, prior, criterion, {});
    ASSERT_EQ(pairs.size(), 3u);
    EXPECT_EQ(pairs[0].first, 1);
    EXPECT_EQ(pairs[0].second, 2);
    EXPECT_EQ(pairs[2].first, 0);
    EXPECT_EQ(pairs[2].second, 1);
    EXPECT_NEAR(pairs[0].value, plan[1].value, 1e-13);
  }
  // det of 1 + 2·242 along the sum's axis and 1 + 2·16... in closed form: eigenvalues 1 + 2 s².
  EXPECT_NEAR(greedy_design(kThree, prior, DesignCriterion::d_optimality, {}, 2)[1].value,
              -std::log((1 + 2 * 121.) * (1 + 2 * 16.)), 1e-12);
  EXPECT_NEAR(greedy_design(kThree, prior, DesignCriterion::a_optimality, {}, 2)[1].value, 1 / 243. + 1 / 33.,
              1e-14);
}

TEST(Design, WhatHasBeenFilmedCounts) {
  const VectorXd prior = Eigen::Vector2d(1, 1);
  // The sum is known already: now the difference is best.
  const auto plan = greedy_design(kThree, prior, DesignCriterion::d_optimality, {1}, 1);
  ASSERT_EQ(plan.size(), 1u);
  EXPECT_EQ(plan[0].experiment, 2);
}

TEST(Design, DAndADisagreeAboutScales) {
  // The first halves a large variance, the second divides a small one by a hundred: A wants the first, D the
  // second.
  const VectorXd prior = Eigen::Vector2d(1, 0.1);
  const std::vector<MatrixXd> roots = {row(1, 0), row(0, 100)};
  EXPECT_EQ(greedy_design(roots, prior, DesignCriterion::a_optimality, {}, 1)[0].experiment, 0);
  EXPECT_EQ(greedy_design(roots, prior, DesignCriterion::d_optimality, {}, 1)[0].experiment, 1);
}

TEST(Design, RefusesAPriorThatIsNone) {
  EXPECT_THROW(posterior({row(1, 1)}, {0}, Eigen::Vector2d(1, INFINITY)), ContractError);
  EXPECT_THROW(posterior({row(1, 1)}, {0}, Eigen::Vector2d(0, 1)), ContractError);
  EXPECT_THROW(posterior({row(1, 1)}, {0}, Eigen::Vector3d(1, 1, 1)), ContractError);
}

}  // namespace
}  // namespace rhytid::adjoint
