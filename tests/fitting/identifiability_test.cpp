// Intervals and null directions from hand-made Jacobians.
#include "fitting/identifiability.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

namespace rhytid::fitting {
namespace {

using testing::HasSubstr;

std::vector<FitVariable> variables(std::vector<std::string> names) {
  std::vector<FitVariable> list;
  for (const std::string& name : names)
    list.push_back({.address = "/" + name,
                    .name = name,
                    .unit = "",
                    .transform = ParameterTransform::log,
                    .initial = 1,
                    .lower = 0.1,
                    .upper = 10,
                    .prior_sigma = {}});
  return list;
}

MatrixXd random_matrix(int rows, int cols, double scale) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal(0, scale);
  MatrixXd m(rows, cols);
  for (double& x : m.reshaped()) x = normal(rng);
  return m;
}

TEST(Identifiability, AgreesWithTheInverseNormalMatrix) {
  const MatrixXd j = random_matrix(50, 3, 10);
  const MatrixXd covariance = (j.transpose() * j).inverse();
  const Identifiability found(j, variables({"a", "b", "c"}), 1.5);
  EXPECT_EQ(found.rank(), 3);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(found.sigma(k), 1.5 * std::sqrt(covariance(k, k)), 1e-12);
  EXPECT_NEAR(found.correlation()(0, 2), covariance(0, 2) / std::sqrt(covariance(0, 0) * covariance(2, 2)),
              1e-12);
  EXPECT_TRUE(found.cannot_tell().empty());
}

TEST(Identifiability, NamesAnExactTradeOffAndKeepsTheRatio) {
  MatrixXd j = random_matrix(50, 3, 10);
  j.col(1) = -j.col(0);  // a and b scaled together change nothing
  const Identifiability found(j, variables({"a", "b", "c"}), 1);
  EXPECT_EQ(found.rank(), 2);
  EXPECT_TRUE(std::isinf(found.sigma(0)));
  EXPECT_TRUE(std::isfinite(found.sigma(2)));
  EXPECT_TRUE(std::isfinite(found.sigma(Vec3(1, -1, 0))));
  EXPECT_TRUE(std::isnan(found.correlation()(0, 1)));
  EXPECT_FALSE(found.determined(0));
  EXPECT_TRUE(found.determined(2));
  const auto sentences = found.cannot_tell();
  ASSERT_EQ(sentences.size(), 3u);
  EXPECT_THAT(sentences[0], testing::AnyOf(HasSubstr("a, b go together"), HasSubstr("b, a go together")));
  EXPECT_THAT(sentences[1], HasSubstr("does not determine a: any value fits"));
}

TEST(Identifiability, WeakDirectionIsAStatementNotAnError) {
  MatrixXd j = random_matrix(50, 2, 10);
  j.col(1) = j.col(0) + 1e-3 * j.col(1);
  const Identifiability found(j, variables({"soft modulus", "ligament k"}), 1);
  EXPECT_EQ(found.rank(), 2);
  EXPECT_FALSE(found.determined(1));
  EXPECT_THAT(found.cannot_tell().at(0), HasSubstr("trade off against"));
}

TEST(Identifiability, StudentQuantiles) {
  EXPECT_NEAR(student_quantile_975(4), 2.7764, 0.01);  // tables
  EXPECT_NEAR(student_quantile_975(10), 2.2281, 2e-4);
  EXPECT_NEAR(student_quantile_975(30), 2.0423, 1e-4);
  EXPECT_NEAR(student_quantile_975(100000), 1.95998, 1e-4);
}

TEST(Identifiability, AutocorrelationOfAnAutoregressiveProcess) {
  std::mt19937 rng(7);
  std::normal_distribution<double> normal;
  std::vector<MatrixXd> series;
  std::vector<std::vector<int>> frames;
  for (int track = 0; track < 200; ++track) {
    MatrixXd x(40, 2);
    for (int axis = 0; axis < 2; ++axis) {
      x(0, axis) = normal(rng) / std::sqrt(1 - 0.36);
      for (int f = 1; f < 40; ++f) x(f, axis) = 0.6 * x(f - 1, axis) + normal(rng);
    }
    series.push_back(x);
    frames.emplace_back();
    for (int f = 0; f < 40; ++f) frames.back().push_back(f);
  }
  EXPECT_NEAR(lag_one_autocorrelation(series, frames), 0.6, 0.02);
  for (auto& list : frames)
    for (int& f : list) f *= 2;  // no neighbours
  EXPECT_EQ(lag_one_autocorrelation(series, frames), 0);
}

}  // namespace
}  // namespace rhytid::fitting
