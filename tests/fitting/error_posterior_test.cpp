// What residuals leave of errors, in linear problems where all is known: against fits of all together, over many draws, and
// where errors cannot be seen, compete, or are those of finer steps.
#include "fitting/error_posterior.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <cstdio>
#include <random>

#include "fitting/identifiability.h"

namespace rhytid::fitting {
namespace {

constexpr Eigen::Index kRows = 200;
constexpr int kDegrees = 198;

MatrixXd random(Eigen::Index columns, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(kRows, columns, [&] { return normal(rng); });
}

/// A fit of two parameters to noise of variance 1 and errors of the model.
struct Linear {
  MatrixXd columns;  ///< that the errors may have
  FitProblem::Linearised at;
  MatrixXd basis;
  VectorXd error;  ///< of the answer

  Linear(const MatrixXd& its_columns, const VectorXd& off, unsigned seed)
      : columns(its_columns), at{{}, random(2, 1)} {
    const MatrixXd& j = at.jacobian;
    const VectorXd z = random(1, seed) - columns * off;
    error = -j.colPivHouseholderQr().solve(z);
    at.residuals = z + j * error;
    basis = MatrixXd(j.transpose() * j).llt().matrixU().solve(MatrixXd::Identity(2, 2));
  }
  ErrorPosterior posterior() const { return error_posterior(at, basis, columns, kDegrees, 0); }
  MatrixXd shifts() const { return -basis * (basis.transpose() * (at.jacobian.transpose() * columns)); }
  SystematicShift shift(const std::string& name, Eigen::Index column) const {
    SystematicShift s;
    s.name = name;
    s.columns = columns.col(column);
    const VectorXd moved = shifts().col(column);
    s.shift.assign(moved.begin(), moved.end());
    return s;
  }
};

/// Two columns that the parameters make most of.
MatrixXd two() {
  return 0.3 * random(2, 2) + 3 * random(2, 1);
}

TEST(ErrorPosterior, IsThatOfAFitWithPriors) {
  const Linear fit(two(), Eigen::Vector2d(3, -0.1), 3);
  const ErrorPosterior found = fit.posterior();
  const double w = std::sqrt(found.variance);
  // The same by a fit of all together, with a row for each prior.
  MatrixXd all = MatrixXd::Zero(kRows + 2, 4);
  all.topRows(kRows) << fit.at.jacobian / w, fit.columns / w;
  all.bottomRightCorner(2, 2).setIdentity();
  VectorXd z = VectorXd::Zero(kRows + 2);
  z.head(kRows) = fit.at.residuals / w;
  const VectorXd together = -all.colPivHouseholderQr().solve(z);
  const MatrixXd covariance = (all.transpose() * all).inverse();
  EXPECT_LT((found.mean - together.tail(2)).norm(), 1e-9);
  EXPECT_LT((found.covariance - covariance.bottomRightCorner(2, 2)).norm(), 1e-9);
  EXPECT_GT(found.squares()(0, 0), 3) << "off by more than was thought before";
  EXPECT_LT(found.squares()(1, 1), 0.6);
}

TEST(ErrorPosterior, VarianceIsThatOfWhatIsLeftAndOfWhatFirstOrderMisses) {
  const Linear fit(two(), Eigen::Vector2d(2, 1), 3);
  const ErrorPosterior found = fit.posterior();
  const MatrixXd own =
      fit.columns - fit.at.jacobian * fit.at.jacobian.colPivHouseholderQr().solve(fit.columns);
  const double left =
      (fit.at.residuals - own * own.colPivHouseholderQr().solve(fit.at.residuals)).squaredNorm();
  const double noise = std::max(1.0, left / (kDegrees - 2));
  const MatrixXd normal = own.transpose() * own, one = MatrixXd::Identity(2, 2);
  const MatrixXd prior = (normal + noise * one).inverse();
  const double believed = (own * found.mean).squaredNorm(), told = (prior * normal).trace();
  EXPECT_GT(believed, 20);
  EXPECT_NEAR(found.variance, noise + kFirstOrder * kFirstOrder * believed / told, 1e-9 * found.variance);
  // Residuals that repeat each other tell less.
  EXPECT_GT(error_posterior(fit.at, fit.basis, fit.columns, kDegrees, 0.5).covariance.trace(),
            found.covariance.trace());
}

// Over draws of errors that are as large as they are said to be: squared errors of the answer over what is said of them.
TEST(ErrorPosterior, SaysHowFarTheAnswerIsOff) {
  for (const double scale : {0.03, 0.3, 3.}) {  // of the columns: hardly told, told in part, told
    const MatrixXd columns = scale * two();
    const MatrixXd noise = MatrixXd(random(2, 1).transpose() * random(2, 1)).inverse();
    double ratio = 0;
    int held = 0;
    constexpr int kDraws = 400;
    for (int draw = 0; draw < kDraws; ++draw) {
      const Linear fit(columns, random(1, 1000 + draw).topRows(2), 5000 + draw);
      const MatrixXd shifts = fit.shifts();
      const double variance = (noise + shifts * fit.posterior().squares() * shifts.transpose())(0, 0);
      ratio += fit.error[0] * fit.error[0] / variance / kDraws;
      held += std::fabs(fit.error[0]) <= 1.96 * std::sqrt(variance) ? 1 : 0;
    }
    std::printf("columns times %g: squared errors over variances %.2f, intervals hold %.1f %%\n", scale,
                ratio, 100. * held / kDraws);
    EXPECT_GT(ratio, 0.7);
    EXPECT_LT(ratio, 1.15);
    EXPECT_GE(held, 0.93 * kDraws);
  }
}

TEST(ErrorPosterior, WhatResidualsDoNotShowCountsInFull) {
  const MatrixXd j = random(2, 1);
  const Linear fit(j * Eigen::Matrix2d{{1, 2}, {0.5, -1}}, Eigen::Vector2d(1, 1), 3);
  EXPECT_LT((fit.posterior().squares() - MatrixXd::Identity(2, 2)).norm(), 1e-9);
  std::vector<SystematicShift> shifts = {fit.shift("held a", 0), fit.shift("held b", 1)};
  const std::vector<SystematicShift> before = shifts;
  weigh_by_residuals(fit.at, fit.basis, kDegrees, 0, shifts);
  ASSERT_EQ(shifts.size(), 3u);
  EXPECT_EQ(shifts[2].name, kTogether);
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t s = 0; s < 2; ++s) EXPECT_NEAR(shifts[s].shift[k], before[s].shift[k], 1e-9);
    EXPECT_NEAR(shifts[2].shift[k], std::hypot(before[0].shift[k], before[1].shift[k]), 1e-9);
  }
}

// One error that is thought smaller widens less, down to nothing where it is exact.
TEST(ErrorPosterior, LessDeviationIsLessWidth) {
  const MatrixXd column = two().col(0);
  for (const double off : {0., 0.5, 4.}) {
    double wider = 0;
    for (const double sigma : {1e-6, 0.03, 0.1, 0.3, 1., 3., 10.}) {
      const Linear fit(sigma * column, VectorXd::Constant(1, off / sigma), 3);
      const double width = sigma * std::sqrt(fit.posterior().squares()(0, 0));
      EXPECT_LE(width, sigma * (1 + 1e-9) + std::fabs(off));
      EXPECT_GT(width, wider) << off << " " << sigma;
      wider = width;
    }
    EXPECT_NEAR(wider, off, 0.3) << "of so little knowledge residuals tell all";
  }
}

// The further a thing is off from what is said of it, the wider.
TEST(ErrorPosterior, MoreIsOffIsMoreWidth) {
  const MatrixXd column = 30 * two().col(0);  // told well
  double wider = 0;
  for (const double off : {0., 1., 2., 3., 5., 10., 20., 50., 200.}) {
    const Linear fit(column, VectorXd::Constant(1, off), 3);
    const double left = std::sqrt(fit.posterior().squares()(0, 0));
    EXPECT_GT(left, wider) << off;
    EXPECT_LE(left, std::max(1., 1.1 * off)) << off;
    wider = left;
  }
}

// Parameters that the residuals do not tell at all, or only together.
TEST(ErrorPosterior, JacobiansWithoutFullRankAreTaken) {
  for (const int rank : {0, 1}) {
    FitProblem::Linearised at;
    at.residuals = random(1, 3);
    at.jacobian = MatrixXd::Zero(kRows, 2);
    MatrixXd basis(2, rank);
    if (rank == 1) {
      at.jacobian = random(1, 4) * Eigen::RowVector2d(1, 1);
      basis = Eigen::Vector2d(0.5, 0.5) / random(1, 4).norm();
    }
    std::vector<SystematicShift> shifts(2);
    shifts[0].name = "plane", shifts[1].name = "held b";
    for (std::size_t s = 0; s < 2; ++s) {
      shifts[s].columns = random(1, 5 + static_cast<unsigned>(s));
      const VectorXd moved = -basis * (basis.transpose() * (at.jacobian.transpose() * shifts[s].columns));
      shifts[s].shift.assign(moved.begin(), moved.end());
    }
    weigh_by_residuals(at, basis, kDegrees, 0, shifts);
    ASSERT_EQ(shifts.size(), 3u) << rank;
    for (const double moved : shifts[2].shift) EXPECT_TRUE(rank == 0 ? moved == 0 : moved > 0) << rank;
  }
}

// What looks like either of two errors is blamed on both; what tells one of them from the other is known of their sum.
TEST(ErrorPosterior, IsJoint) {
  MatrixXd columns = two();
  columns.col(1) = columns.col(0) + 1e-3 * columns.col(1);
  const Linear fit(columns, Eigen::Vector2d(2, 0), 3);
  const ErrorPosterior found = fit.posterior();
  EXPECT_NEAR(found.mean[0], 1, 0.3);
  EXPECT_NEAR(found.mean[1], 1, 0.3);
  EXPECT_LT(found.covariance(0, 1), -0.35);
  std::vector<SystematicShift> shifts = {fit.shift("held a", 0), fit.shift("held b", 1)};
  weigh_by_residuals(fit.at, fit.basis, kDegrees, 0, shifts);
  EXPECT_GT(shifts[2].shift[0], 1.05 * std::hypot(shifts[0].shift[0], shifts[1].shift[0]))
      << "both at a time, not in squares";
  EXPECT_LT(shifts[2].shift[0], std::fabs(shifts[0].shift[0]) + std::fabs(shifts[1].shift[0]) + 1e-9);
}

TEST(ErrorPosterior, FinerStepsAreNeverLessThanTheyAre) {
  for (const double off : {0., 5.}) {
    MatrixXd columns = two();
    columns.col(1) *= 0.1;
    const Linear fit(columns, Eigen::Vector2d(off, 0.3), 3);
    std::vector<SystematicShift> shifts = {fit.shift("plane", 0), fit.shift("held b", 1)};
    const std::vector<SystematicShift> before = shifts;
    weigh_by_residuals(fit.at, fit.basis, kDegrees, 0, shifts);
    ASSERT_EQ(shifts.size(), 3u);
    EXPECT_EQ(shifts[0].shift, before[0].shift);
    EXPECT_TRUE(shifts[0].left.empty());
    EXPECT_NEAR(shifts[1].shift[0], shifts[1].left[0] * before[1].shift[0], 1e-12) << "with its sign";
    const std::vector<const SystematicShift*> counted = counted_shifts(shifts);
    ASSERT_EQ(counted.size(), 1u);
    for (std::size_t k = 0; k < 2; ++k) {
      const double apart = std::hypot(shifts[0].shift[k], shifts[1].shift[k]);
      EXPECT_GE(counted[0]->shift[k], apart * (1 - 1e-9));
      if (off > 0 && k == 0) {
        EXPECT_GT(counted[0]->shift[k], 1.2 * apart) << "residuals say that it is more";
      }
    }
  }
}

TEST(ErrorPosterior, WithoutAnythingHeldAllStays) {
  const Linear fit(two(), Eigen::Vector2d(3, 0), 3);
  std::vector<SystematicShift> shifts = {fit.shift("plane", 0)};
  SystematicShift& failed = shifts.emplace_back();
  failed.name = "held b", failed.failure = "it cannot run";
  weigh_by_residuals(fit.at, fit.basis, kDegrees, 0, shifts);
  ASSERT_EQ(shifts.size(), 2u);
  EXPECT_EQ(counted_shifts(shifts).size(), 1u);
}

}  // namespace
}  // namespace rhytid::fitting
