// Intervals and null directions from hand-made Jacobians.
#include "fitting/identifiability.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <numeric>
#include <random>

#include "fitting/track_noise.h"
#include "log_variables.h"

namespace rhytid::fitting {
namespace {

using ::testing::HasSubstr;
using testing::log_variables;

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
  const Identifiability found(j, log_variables({"a", "b", "c"}), 1.5, 47);
  EXPECT_EQ(found.rank(), 3);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(found.sigma(k), 1.5 * std::sqrt(covariance(k, k)), 1e-12);
    EXPECT_NEAR(found.half_width(k), student_quantile_975(47) * found.sigma(k), 1e-12);
  }
  EXPECT_NEAR(found.correlation()(0, 2), covariance(0, 2) / std::sqrt(covariance(0, 0) * covariance(2, 2)),
              1e-12);
  EXPECT_TRUE(found.cannot_tell().empty());
}

// One matrix for deviations and correlations: nowhere below the noise's or the misfit's, and theirs where one
// of them is everywhere more. Quantiles belong to intervals and not to deviations.
TEST(Identifiability, OneCovarianceOfNoiseAndMisfit) {
  constexpr int kTracks = 50, kParameters = 3;
  const MatrixXd j = random_matrix(kTracks, kParameters, 10);
  const auto names = log_variables({"a", "b", "c"});
  const auto tracks = [&](double size) {
    std::mt19937 rng(8);
    std::normal_distribution<double> normal;
    std::vector<WhitenedTrack> list;
    for (int i = 0; i < kTracks; ++i)
      list.push_back({Vec3(i % 7, i / 7, 0), {0}, j.row(i), VectorXd::Constant(1, size * normal(rng))});
    return list;
  };
  const Identifiability noise(j, names, 1.5, 47);
  EXPECT_LT((noise.basis().transpose() * j.transpose() * j * noise.basis() - Mat3::Identity()).norm(), 1e-12);
  const MatrixXd by_noise = 2.25 * (j.transpose() * j).inverse();
  for (const double size : {1e3, 1.5, 1e-3}) {
    const Identifiability both(j, names, 1.5, 47, tracks(size));
    const SpatialMisfit misfit(tracks(size), noise.basis());
    const MatrixXd by_misfit = noise.basis() * misfit.covariance() * noise.basis().transpose();
    MatrixXd covariance = both.correlation();
    for (int a = 0; a < kParameters; ++a)
      for (int b = 0; b < kParameters; ++b) covariance(a, b) *= both.sigma(a) * both.sigma(b);
    const VectorXd any = Vec3(0.3, -0.5, 0.8);  // a direction: the same matrix again
    EXPECT_NEAR(both.sigma(any), std::sqrt(any.dot(covariance * any)), 1e-12 * size + 1e-13);
    for (const MatrixXd& part : {by_noise, by_misfit})
      EXPECT_GT((covariance - part).selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(),
                -1e-12 * covariance.norm());
    if (size == 1.5) {
      EXPECT_GT((covariance - by_noise).norm(), 0.01 * covariance.norm());
      EXPECT_GT((covariance - by_misfit).norm(), 0.01 * covariance.norm());
      continue;
    }
    EXPECT_LT((covariance - (size > 1 ? by_misfit : by_noise)).norm(), 1e-10 * covariance.norm());
    for (int k = 0; k < kParameters; ++k) {
      const VectorXd g = VectorXd::Unit(kParameters, k);
      const double degrees = size > 1 ? misfit.degrees(noise.basis().transpose() * g) : 47;
      EXPECT_NEAR(both.degrees(g), degrees, 1e-9 * degrees);
      EXPECT_NEAR(both.half_width(k), student_quantile_975(degrees) * both.sigma(k),
                  1e-9 * both.half_width(k));
      EXPECT_NEAR(both.widened_by_misfit(k), size > 1 ? both.sigma(k) / noise.sigma(k) : 1, 1e-9 * size);
    }
  }
}

// Shifts that no residual shows: added to the covariance, in intervals with the quantile of a normal law.
TEST(Identifiability, SystematicShiftsAddToTheCovariance) {
  const MatrixXd j = random_matrix(50, 3, 10);
  const MatrixXd covariance = (j.transpose() * j).inverse();
  Identifiability found(j, log_variables({"a", "b", "c"}), 1.5, 47);
  const double half = found.half_width(0);
  const Vec3 one(0.3, -0.1, 0), other(0, 0.2, 0.05);
  found.add_systematic({one.begin(), one.end()});
  found.add_systematic({other.begin(), other.end()});
  const Mat3 all = 2.25 * covariance + one * one.transpose() + other * other.transpose();
  const Vec3 g(0.5, 2, -1);
  EXPECT_NEAR(found.sigma(g), std::sqrt(g.dot(all * g)), 1e-12);
  EXPECT_NEAR(found.noise_sigma(g), 1.5 * std::sqrt(g.dot(covariance * g)), 1e-12);
  EXPECT_NEAR(found.correlation()(0, 1), all(0, 1) / std::sqrt(all(0, 0) * all(1, 1)), 1e-12);
  EXPECT_NEAR(found.half_width(0), std::hypot(half, 1.959963984540054 * 0.3), 1e-12);
  EXPECT_NEAR(found.widened_by_misfit(1), 1, 1e-12) << "that is another matter";
  found.add_systematic({2, 0, 0});
  EXPECT_FALSE(found.determined(0)) << "a factor e and more";
  EXPECT_TRUE(found.determined(2));
}

TEST(Identifiability, NamesAnExactTradeOffAndKeepsTheRatio) {
  MatrixXd j = random_matrix(50, 3, 10);
  j.col(1) = -j.col(0);  // a and b scaled together change nothing
  const Identifiability found(j, log_variables({"a", "b", "c"}), 1, 40);
  EXPECT_EQ(found.rank(), 2);
  EXPECT_TRUE(std::isinf(found.sigma(0)));
  EXPECT_TRUE(std::isfinite(found.sigma(2)));
  EXPECT_TRUE(std::isfinite(found.sigma(Vec3(1, -1, 0))));
  EXPECT_TRUE(std::isnan(found.correlation()(0, 1)));
  EXPECT_FALSE(found.determined(0));
  EXPECT_TRUE(found.determined(2));
  const auto sentences = found.cannot_tell();
  ASSERT_EQ(sentences.size(), 3u);
  EXPECT_THAT(sentences[0], ::testing::AnyOf(HasSubstr("a, b go together"), HasSubstr("b, a go together")));
  EXPECT_THAT(sentences[1], HasSubstr("does not determine a: any value fits"));
}

TEST(Identifiability, WeakDirectionIsAStatementNotAnError) {
  MatrixXd j = random_matrix(50, 2, 10);
  j.col(1) = j.col(0) + 1e-3 * j.col(1);
  const Identifiability found(j, log_variables({"soft modulus", "ligament k"}), 1, 40);
  EXPECT_EQ(found.rank(), 2);
  EXPECT_FALSE(found.determined(1));
  EXPECT_THAT(found.cannot_tell().at(0), HasSubstr("trade off against"));
}

TEST(Identifiability, DirectionsOfManyParametersHaveNames) {
  constexpr int n = 25;  // a common scale of all of them: every component is 0.2
  const MatrixXd any = random_matrix(60, n, 12);
  const VectorXd common = VectorXd::Constant(n, 1 / std::sqrt(double(n)));
  const MatrixXd j = any - (any * common) * common.transpose();
  std::vector<std::string> names;
  for (int k = 0; k < n; ++k) names.push_back("p" + std::to_string(k));
  const Identifiability found(j, log_variables(names), 1, 40);
  EXPECT_EQ(found.rank(), n - 1);
  EXPECT_THAT(found.cannot_tell().at(0),
              ::testing::AllOf(HasSubstr("p"), HasSubstr(" and 17 more go together")));
}

// Intervals as a fit makes them, over repeated noise of exactly the stated kind, in a problem that is linear:
// tracks with a common first error and their own ones, whitened by TrackNoise, widened as a fit does.
TEST(Identifiability, IntervalsHoldTheTruthAsOftenAsTheySay) {
  constexpr int kTracks = 36, kFrames = 8, kParameters = 3, kRepeats = 1500;
  constexpr double kFirst = 0.03, kOwn = 0.05;  // px
  const Eigen::Matrix2d first = kFirst * kFirst * Eigen::Matrix2d::Identity();
  const std::vector<Eigen::Matrix2d> later(kFrames, kOwn * kOwn * Eigen::Matrix2d::Identity());
  std::vector<MatrixXd> jacobians;
  const MatrixXd all = random_matrix(2 * kFrames * kTracks, kParameters, 1);
  for (int i = 0; i < kTracks; ++i) jacobians.push_back(all.middleRows(2 * kFrames * i, 2 * kFrames));
  for (const double huber : {0.0, 3.0}) {
    const TrackNoise noise(first, later, huber);
    std::mt19937 rng(5);
    std::normal_distribution<double> normal;
    int inside = 0;
    double chi = 0, width = 0;
    for (int repeat = 0; repeat < kRepeats; ++repeat) {
      std::vector<VectorXd> errors;
      for (int i = 0; i < kTracks; ++i) {
        const Vec2 common(kFirst * normal(rng), kFirst * normal(rng));
        VectorXd r(2 * kFrames);
        for (int f = 0; f < kFrames; ++f)
          r.segment<2>(2 * f) = common + kOwn * Vec2(normal(rng), normal(rng));
        errors.push_back(r);
      }
      VectorXd t = VectorXd::Zero(kParameters), z(kTracks * noise.num_rows());
      MatrixXd j(kTracks * noise.num_rows(), kParameters);
      std::vector<MatrixXd> innovations;
      for (int round = 0; round < 4; ++round) {  // robust weights settle
        innovations.clear();
        for (int i = 0; i < kTracks; ++i) {
          const VectorXd r = errors[i] - jacobians[i] * t;
          const auto at = noise.evaluate(r);
          z.segment(i * noise.num_rows(), noise.num_rows()) = noise.weighted_residual(r, at);
          j.middleRows(i * noise.num_rows(), noise.num_rows()) = noise.weighted_jacobian(at, jacobians[i]);
          innovations.push_back(noise.innovations(r, at));
        }
        t += j.householderQr().solve(z);
      }
      const int dof = 2 * kTracks * kFrames - kParameters;
      std::vector<int> frames(kFrames);
      std::iota(frames.begin(), frames.end(), 1);
      const double squares = z.squaredNorm() / dof;
      const double rho = lag_one_autocorrelation(innovations, std::vector<std::vector<int>>(kTracks, frames));
      std::vector<WhitenedTrack> tracks;
      const int rows = noise.num_rows();
      std::vector<int> numbers(rows);
      std::iota(numbers.begin(), numbers.end(), 0);
      for (int i = 0; i < kTracks; ++i)
        tracks.push_back(
            {Vec3(i % 6, i / 6, 0), numbers, j.middleRows(i * rows, rows), z.segment(i * rows, rows)});
      const Identifiability found(j, log_variables({"a", "b", "c"}), interval_widening(squares, rho), dof,
                                  tracks);
      for (int k = 0; k < kParameters; ++k) inside += std::fabs(t[k]) <= found.half_width(k);
      chi += squares / kRepeats;
      width += interval_widening(squares, rho) / kRepeats;
    }
    const double coverage = double(inside) / (kRepeats * kParameters);
    std::printf(
        "Huber %.0f: %.1f %% of intervals hold the truth, mean reduced chi-square %.3f, widening %.3f\n",
        huber, 100 * coverage, chi, width);
    EXPECT_GT(coverage, 0.94);
    EXPECT_LT(coverage, 0.985);
    EXPECT_NEAR(chi, 1, 0.04);
  }
}

TEST(Identifiability, StudentQuantiles) {
  EXPECT_NEAR(student_quantile_975(0), 12.706204736, 1e-8);  // tables; no freedom left counts as one
  EXPECT_NEAR(student_quantile_975(1), 12.706204736, 1e-8);
  EXPECT_NEAR(student_quantile_975(2), 4.302652730, 1e-8);
  EXPECT_NEAR(student_quantile_975(3), 3.182446305, 1e-8);
  EXPECT_NEAR(student_quantile_975(4), 2.776445105, 1e-8);
  EXPECT_NEAR(student_quantile_975(10), 2.228138852, 1e-8);
  EXPECT_NEAR(student_quantile_975(30), 2.042272456, 1e-8);
  EXPECT_NEAR(student_quantile_975(100), 1.983971519, 1e-8);
  EXPECT_NEAR(student_quantile_975(120), 1.979930405, 1e-7);
  EXPECT_NEAR(student_quantile_975(100000), 1.95998, 1e-4);
  EXPECT_NEAR(student_quantile_975(1.5), 6.0166631, 1e-6);  // between, by integrating the density
  EXPECT_NEAR(student_quantile_975(6.3), 2.4189428, 1e-6);
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
