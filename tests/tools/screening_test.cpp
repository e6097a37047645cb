// Morris's effects and Sobol's indices of functions where they are known.
#include "tools/study/screening.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <set>

#include "sim/core/error.h"

namespace rhytid::tools {
namespace {

using Function = std::function<double(const VectorXd&)>;

VectorXd values_of(const MatrixXd& points, const Function& f) {
  VectorXd values(points.rows());
  for (Eigen::Index i = 0; i < points.rows(); ++i) values[i] = f(points.row(i).transpose());
  return values;
}

TEST(MorrisDesign, MovesEveryInputOnceInATrajectoryAndStaysOnTheLevels) {
  const int inputs = 5, trajectories = 40, levels = 6;
  const MorrisDesign d = morris_design(inputs, trajectories, levels, 3);
  EXPECT_NEAR(d.step, 0.6, 1e-15);
  ASSERT_EQ(d.points.rows(), trajectories * (inputs + 1));
  std::set<int> levels_seen;
  for (Eigen::Index i = 0; i < d.points.rows(); ++i)
    for (const double x : d.points.row(i)) {
      const double level = x * (levels - 1);
      EXPECT_NEAR(level, std::round(level), 1e-12);
      levels_seen.insert(static_cast<int>(std::round(level)));
    }
  EXPECT_EQ(levels_seen, (std::set<int>{0, 1, 2, 3, 4, 5}));
  for (int t = 0; t < trajectories; ++t) {
    std::set<int> moved;
    for (int s = 0; s < inputs; ++s) {
      const Eigen::Index at = t * (inputs + 1) + s;
      const VectorXd step = d.points.row(at + 1) - d.points.row(at);
      const int i = d.moved[t * inputs + s];
      EXPECT_NEAR(std::abs(step[i]), d.step, 1e-12);
      EXPECT_NEAR(step.norm(), d.step, 1e-12);
      moved.insert(i);
    }
    EXPECT_EQ(moved.size(), 5u);
  }
  EXPECT_EQ((d.points - morris_design(inputs, trajectories, levels, 3).points).norm(), 0);
  EXPECT_GT((d.points - morris_design(inputs, trajectories, levels, 4).points).norm(), 1);
}

TEST(MorrisEffects, OfALinearFunctionAreItsCoefficients) {
  const MorrisDesign d = morris_design(3, 10, 4, 1);
  const auto effects =
      morris_effects(d, values_of(d.points, [](const VectorXd& x) { return 7 + 3 * x[0] - 2 * x[1]; }));
  const double expected[] = {3, -2, 0};
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(effects[i].mean, expected[i], 1e-12);
    EXPECT_NEAR(effects[i].mean_absolute, std::abs(expected[i]), 1e-12);
    EXPECT_NEAR(effects[i].deviation, 0, 1e-12);
    EXPECT_EQ(effects[i].count, 10);
  }
}

TEST(MorrisEffects, OfAProductHaveTheSpreadOfTheOtherFactor) {
  // The effect of x0 on x0·x1 is x1, uniform on the four levels 0, 1/3, 2/3, 1: mean 1/2, variance 5/36.
  const MorrisDesign d = morris_design(2, 4000, 4, 5);
  const auto effects = morris_effects(d, values_of(d.points, [](const VectorXd& x) { return x[0] * x[1]; }));
  for (const MorrisEffect& e : effects) {
    EXPECT_NEAR(e.mean, 0.5, 4 * std::sqrt(5 / 36. / 4000));
    EXPECT_NEAR(e.deviation, std::sqrt(5 / 36.), 0.01);
    EXPECT_NEAR(e.error, e.deviation / std::sqrt(4000.), 1e-4);
  }
  // Signs cancel in the mean, not in that of sizes: (x0 − 1/2)² goes down and up by Δ = 2/3: between levels
  // 0 and 2/3 by −2/9, between 1/3 and 1 by 2/9, effects ∓1/3.
  const auto bowl =
      morris_effects(d, values_of(d.points, [](const VectorXd& x) { return std::pow(x[0] - 0.5, 2); }));
  EXPECT_NEAR(bowl[0].mean, 0, 0.02);
  EXPECT_NEAR(bowl[0].mean_absolute, 1 / 3., 1e-12);
}

TEST(MorrisEffects, LeaveOutWhatIsMissing) {
  const MorrisDesign d = morris_design(3, 4, 4, 2);
  VectorXd values = values_of(d.points, [](const VectorXd& x) { return x.sum(); });
  values[1] = std::nan("");  // ends the first step of the first trajectory and starts its second
  const auto effects = morris_effects(d, values);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(effects[i].count, i == d.moved[2] ? 4 : 3);
    EXPECT_NEAR(effects[i].mean, 1, 1e-12);
  }
}

double ishigami(const VectorXd& unit) {
  const VectorXd x = (2 * unit.array() - 1) * std::numbers::pi;
  return std::sin(x[0]) + 7 * std::pow(std::sin(x[1]), 2) + 0.1 * std::pow(x[2], 4) * std::sin(x[0]);
}

TEST(SobolIndices, OfIshigamisFunctionAreThoseOfTheLiterature) {
  const int samples = 8192;
  const auto s = sobol_indices(3, samples, values_of(sobol_design(3, samples, 1), ishigami), 1);
  const double first[] = {0.3139, 0.4424, 0}, total[] = {0.5576, 0.4424, 0.2437};
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(s[i].first, first[i], 0.025) << i;
    EXPECT_NEAR(s[i].total, total[i], 0.025) << i;
    EXPECT_LT(std::abs(s[i].first - first[i]), 4 * s[i].first_error + 1e-3) << i;
    EXPECT_GT(s[i].first_error, 1e-4);
    EXPECT_LT(s[i].total_error, 0.03);
    EXPECT_EQ(s[i].count, samples);
  }
}

TEST(SobolIndices, OfASumAreItsSharesOfTheVariance) {
  const int samples = 4096;
  const auto s = sobol_indices(
      2, samples,
      values_of(sobol_design(2, samples, 2), [](const VectorXd& x) { return 100 + 3 * x[0] + 4 * x[1]; }), 1);
  EXPECT_NEAR(s[0].first, 9 / 25., 0.02);
  EXPECT_NEAR(s[1].total, 16 / 25., 0.02);
}

TEST(SobolIndices, LeaveOutWhatIsMissingAndSayNothingOfAConstant) {
  const int samples = 4096;
  const MatrixXd points = sobol_design(2, samples, 2);
  VectorXd values = values_of(points, [](const VectorXd& x) { return 3 * x[0] + 4 * x[1]; });
  for (int j = 0; j < samples; j += 4) values[2 * samples + j] = std::nan("");  // of AB_0 only
  const auto s = sobol_indices(2, samples, values, 1);
  EXPECT_EQ(s[0].count, samples - samples / 4);
  EXPECT_EQ(s[1].count, samples);
  EXPECT_NEAR(s[0].first, 9 / 25., 0.03);
  const auto constant = sobol_indices(2, samples, VectorXd::Constant(values.size(), 5), 1);
  EXPECT_TRUE(std::isnan(constant[0].first));
}

TEST(SobolDesign, IsALatinHypercubeOfTwoIndependentHalves) {
  const int samples = 16;
  const MatrixXd p = sobol_design(3, samples, 7);
  ASSERT_EQ(p.rows(), 5 * samples);
  for (int i = 0; i < 3; ++i)
    for (int half = 0; half < 2; ++half) {
      std::set<int> cells;
      for (int j = 0; j < samples; ++j) cells.insert(static_cast<int>(p(half * samples + j, i) * samples));
      EXPECT_EQ(cells.size(), 16u);
    }
  EXPECT_EQ((p.block(3 * samples, 1, samples, 1) - p.block(samples, 1, samples, 1)).norm(), 0);
  EXPECT_EQ((p.block(3 * samples, 0, samples, 1) - p.block(0, 0, samples, 1)).norm(), 0);
  EXPECT_GT((p.topRows(samples) - p.middleRows(samples, samples)).norm(), 1);
}

TEST(Designs, RefuseWhatIsNone) {
  EXPECT_THROW(morris_design(0, 1, 4, 1), ContractError);
  EXPECT_THROW(morris_design(2, 1, 3, 1), ContractError);
  EXPECT_THROW(sobol_design(2, 0, 1), ContractError);
}

}  // namespace
}  // namespace rhytid::tools
