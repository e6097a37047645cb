#include "fitting/tracking/patch_alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "speckle.h"

namespace rhytid::fitting {
namespace {

using testing::AffineMotion;
using testing::Speckle;

constexpr int kSize = 64, kHalf = 10;
const Vec2 kCentre(32, 31);

SplineImage spline_of(const cv::Mat& bytes, double smoothing) {
  cv::Mat real;
  bytes.convertTo(real, CV_32F);
  if (smoothing > 0) cv::GaussianBlur(real, real, {9, 9}, smoothing);
  return SplineImage(real);
}

cv::Mat picture(const Speckle& skin, const AffineMotion& m, double noise, unsigned seed) {
  return skin.render([&](const Vec2& x) { return m.backward(x); }, noise, seed);
}

TEST(PatchAlignment, FindsPositionAndDeformation) {
  const Speckle skin(kSize, kSize, 11);
  AffineMotion m;
  m.centre = kCentre;
  m.translation = {0.63, -0.41};
  m.gradient << 1.04, 0.03, -0.02, 0.97;
  const PatchTemplate patch = cut_template(spline_of(picture(skin, {}, 0, 0), 0), kCentre, kHalf);
  const Alignment a =
      align(patch, spline_of(picture(skin, m, 0, 0), 0), {kCentre, Eigen::Matrix2d::Identity()}, {});
  ASSERT_EQ(a.status, AlignmentStatus::converged);
  EXPECT_LT((a.warp.centre - kCentre - m.translation).norm(), 0.01);
  EXPECT_LT((a.warp.gradient - m.gradient).norm(), 0.005);
  EXPECT_GT(a.correlation, 0.999);
}

// 60 draws of noise: the scatter of the position is what Cov says, in each direction. White noise, then
// smoothed (correlated), where only the pooled autocorrelation gets it right.
void check_covariance(double smoothing, double noise) {
  const Speckle skin(kSize, kSize, 12);
  AffineMotion m;
  m.translation = {0.3, 0.45};
  std::vector<Alignment> alignments;
  for (int draw = 0; draw < 60; ++draw) {
    const PatchTemplate patch =
        cut_template(spline_of(picture(skin, {}, noise, 1000 + draw), smoothing), kCentre, kHalf);
    alignments.push_back(align(patch, spline_of(picture(skin, m, noise, 2000 + draw), smoothing),
                               {kCentre, Eigen::Matrix2d::Identity()}, {}));
    ASSERT_EQ(alignments.back().status, AlignmentStatus::converged);
  }
  std::vector<const Alignment*> pointers;
  for (const Alignment& a : alignments) pointers.push_back(&a);
  const ResidualCorrelation correlation(pointers);
  double full = 0, white = 0;
  for (const Alignment& a : alignments) {
    const Vec2 error = a.warp.centre - kCentre - m.translation;
    full += error.dot(correlation.covariance(a, a.residual_rms).ldlt().solve(error)) / 120;
    white += error.dot((a.residual_rms * a.residual_rms * a.unit_covariance).ldlt().solve(error)) / 120;
  }
  std::printf("smoothing %.1f: normalised variance %.2f, white formula %.2f\n", smoothing, full, white);
  // χ² of 120 degrees of freedom over 120: 0.69 to 1.35 at 99.5 %; gradients with noise in them add a little.
  EXPECT_GT(full, 0.65);
  EXPECT_LT(full, 1.5);
  if (smoothing > 0) {
    EXPECT_GT(white, 3);
    EXPECT_GT(correlation.at(1, 0), 0.5);
    EXPECT_NEAR(correlation.at(1, 0), correlation.at(0, 1), 0.08);
  } else {
    EXPECT_LT(std::abs(correlation.at(2, 1)), 0.1);
  }
  EXPECT_EQ(correlation.at(0, 0), 1);
}

TEST(PatchAlignment, CovarianceIsTheScatterForWhiteNoise) {
  check_covariance(0, 0.7);
}
TEST(PatchAlignment, CovarianceIsTheScatterForCorrelatedNoise) {
  check_covariance(1, 3);
}

/// ResidualCorrelation::variance_ratio of 30 draws of noise.
double variance_ratio(int half, double smoothing) {
  const Speckle skin(kSize, kSize, 12);
  std::vector<Alignment> alignments;
  for (int draw = 0; draw < 30; ++draw) {
    const PatchTemplate patch =
        cut_template(spline_of(picture(skin, {}, 1, 1000 + draw), smoothing), kCentre, half);
    alignments.push_back(align(patch, spline_of(picture(skin, {}, 1, 2000 + draw), smoothing),
                               {kCentre, Eigen::Matrix2d::Identity()}, {}));
  }
  std::vector<const Alignment*> pointers;
  for (const Alignment& a : alignments) pointers.push_back(&a);
  return ResidualCorrelation(pointers).variance_ratio();
}

TEST(PatchAlignment, NoiseThatTheFitFollowsIsCounted) {
  EXPECT_GT(variance_ratio(6, 2), 1.3);
  EXPECT_LT(variance_ratio(kHalf, 0.5), 1.05);
  // In small windows the estimate is uncertain, but the noise is never less than residuals and unknowns say.
  EXPECT_EQ(variance_ratio(3, 0.5), 1);
}

TEST(PatchAlignment, SaysWhyItFailed) {
  const Speckle skin(kSize, kSize, 13);
  const SplineImage image = spline_of(picture(skin, {}, 0, 0), 0);
  const PatchWarp here{kCentre, Eigen::Matrix2d::Identity()};
  const PatchTemplate patch = cut_template(image, kCentre, kHalf);
  EXPECT_EQ(align(patch, image, here, {}).status, AlignmentStatus::converged);
  EXPECT_EQ(align(patch, image, {{5, 5}, here.gradient}, {}).status, AlignmentStatus::outside);
  EXPECT_TRUE(cut_template(image, {8, 30}, kHalf).values.empty());

  const SplineImage uniform(cv::Mat(kSize, kSize, CV_32F, cv::Scalar(80)));
  EXPECT_EQ(align(cut_template(uniform, kCentre, kHalf), uniform, here, {}).status, AlignmentStatus::flat);
  // Stripes fix no position along themselves.
  cv::Mat stripes(kSize, kSize, CV_32F);
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      stripes.at<float>(y, x) = static_cast<float>(128 + 80 * std::sin(0.7 * x));
  const SplineImage aperture(stripes);
  EXPECT_EQ(align(cut_template(aperture, kCentre, kHalf), aperture, here, {}).status, AlignmentStatus::flat);
}

}  // namespace
}  // namespace rhytid::fitting
