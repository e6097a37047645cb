// What residuals say of held things, in linear problems where a fit of all together is known.
#include "fitting/residual_signature.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <random>

namespace rhytid::fitting {
namespace {

using testing::HasSubstr;

constexpr Eigen::Index kRows = 200;

MatrixXd random(Eigen::Index columns, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(kRows, columns, [&] { return normal(rng); });
}

/// A fit of two parameters to residuals that two held things have moved by `off`, and noise.
struct Linear {
  FitProblem::Linearised at;
  MatrixXd basis, columns = random(2, 2);
  Linear(const Eigen::Vector2d& off, double noise) {
    const MatrixXd j = random(2, 1);
    columns += 3 * j;  // mostly what the parameters do too
    const VectorXd z = noise * random(1, 3) - columns * off;
    at.jacobian = j;
    const VectorXd t = -j.colPivHouseholderQr().solve(z);
    at.residuals = z + j * t;
    const MatrixXd normal = j.transpose() * j;
    basis = normal.llt().matrixU().solve(MatrixXd::Identity(2, 2));
  }
};

TEST(ResidualSignature, IsWhatAFitOfAllTogetherFinds) {
  const Linear fit({0.7, -0.2}, 1);
  SystematicShift shift;
  add_signature(fit.at, fit.basis, fit.columns, {{"first", "mm", 0.25}, {"second"}}, shift);
  ASSERT_EQ(shift.signature.size(), 2u);
  MatrixXd all(kRows, 4);
  all << fit.at.jacobian, fit.columns;
  const auto qr = all.colPivHouseholderQr();
  const VectorXd together = -qr.solve(fit.at.residuals);
  const MatrixXd covariance = (all.transpose() * all).inverse();
  for (int k = 0; k < 2; ++k) {
    EXPECT_NEAR(shift.signature[static_cast<std::size_t>(k)].estimate, together[2 + k], 1e-9);
    EXPECT_NEAR(shift.signature[static_cast<std::size_t>(k)].sigma, std::sqrt(covariance(2 + k, 2 + k)),
                1e-9);
  }
  EXPECT_NEAR(shift.signature[0].estimate, 0.7, 0.3);
  EXPECT_NEAR(shift.signature[1].estimate, -0.2, 0.3);
  const double left = (fit.at.residuals + all * together).squaredNorm();
  EXPECT_NEAR(shift.explained, fit.at.residuals.squaredNorm() - left, 1e-8);
}

TEST(ResidualSignature, OfWhatTheParametersDoIsNone) {
  const Linear fit({0.7, -0.2}, 1);
  SystematicShift shift;
  add_signature(fit.at, fit.basis, fit.at.jacobian.col(0), {{"same"}}, shift);
  EXPECT_TRUE(shift.signature.empty());
  EXPECT_EQ(shift.explained, 0);
}

FitResult result_of(const Linear& fit) {
  FitResult result;
  result.reduced_chi_square = fit.at.residuals.squaredNorm() / (kRows - 2);
  SystematicShift& first = result.systematic.emplace_back();
  add_signature(fit.at, fit.basis, fit.columns.col(0), {{"finger path x", "mm", 0.25}}, first);
  SystematicShift& second = result.systematic.emplace_back();
  add_signature(fit.at, fit.basis, fit.columns.col(1), {{"soft thickness", "%", 10}}, second);
  return result;
}

TEST(ResidualSignature, SentencesNameWhatResidualsLookLike) {
  const Linear off({2, 0}, 1);
  const auto sentences = misfit_sentences(result_of(off), kRows - 2, 0);
  ASSERT_EQ(sentences.size(), 1u);
  EXPECT_THAT(sentences[0], HasSubstr("the model misses something"));
  EXPECT_THAT(sentences[0], HasSubstr("finger path x by +0.5"));
  EXPECT_THAT(sentences[0], testing::Not(HasSubstr("thickness")));

  EXPECT_TRUE(misfit_sentences(result_of(Linear({0, 0}, 1)), kRows - 2, 0).empty()) << "only noise";

  FitResult few = result_of(off);
  few.reduced_chi_square = 1.5;
  EXPECT_TRUE(misfit_sentences(few, 10, 0).empty()) << "noise makes as much of ten";
  EXPECT_FALSE(misfit_sentences(few, 1000, 0).empty());
  EXPECT_TRUE(misfit_sentences(few, 1000, 0.9).empty()) << "of residuals that repeat each other too";

  const auto unknown = misfit_sentences(result_of(Linear({0, 0}, 2)), kRows - 2, 0);
  ASSERT_EQ(unknown.size(), 1u);
  EXPECT_THAT(unknown[0], HasSubstr("none of the changes that were considered"));
}

// Only those axes of a group are told that are off; each with its own deviations.
TEST(ResidualSignature, SentencesNameTheAxesThatAreOff) {
  const Linear fit({2, 0}, 1);
  FitResult result;
  result.reduced_chi_square = fit.at.residuals.squaredNorm() / (kRows - 2);
  SystematicShift& shift = result.systematic.emplace_back();
  add_signature(fit.at, fit.basis, fit.columns,
                {{"finger path x", "mm", 0.25}, {"finger path y", "mm", 0.25}}, shift);
  const auto sentences = misfit_sentences(result, kRows - 2, 0);
  ASSERT_EQ(sentences.size(), 1u);
  EXPECT_THAT(
      sentences[0],
      testing::ContainsRegex("finger path x by \\+0\\.[45][0-9]* ± 0\\.0[0-9]+ mm \\([0-9]+ σ\\): reduced"));
  EXPECT_THAT(sentences[0], testing::Not(HasSubstr("finger path y")));
}

}  // namespace
}  // namespace rhytid::fitting
