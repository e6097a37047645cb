#include "fitting/tracking/spline_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

TEST(SplineImage, PassesThroughThePixels) {
  cv::Mat image(23, 70, CV_32F);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> grey(0, 255);
  for (auto it = image.begin<float>(); it != image.end<float>(); ++it) *it = grey(random);
  const SplineImage spline(image);
  for (int y = 1; y < image.rows - 2; ++y)
    for (int x = 1; x < image.cols - 2; ++x)
      EXPECT_NEAR(spline.sample(x, y).value, image.at<float>(y, x), 2e-4);  // float coefficients of size 1000
}

TEST(SplineImage, GradientIsTheDerivativeOfTheValue) {
  cv::Mat image(20, 20, CV_32F);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> grey(0, 255);
  for (auto it = image.begin<float>(); it != image.end<float>(); ++it) *it = grey(random);
  const SplineImage spline(image);
  const double h = 1e-4;
  for (double x = 5.13; x < 14; x += 0.71)
    for (double y = 5.31; y < 14; y += 0.83) {
      const auto s = spline.sample(x, y);
      EXPECT_NEAR((spline.sample(x + h, y).value - spline.sample(x - h, y).value) / (2 * h), s.dx, 1e-4);
      EXPECT_NEAR((spline.sample(x, y + h).value - spline.sample(x, y - h).value) / (2 * h), s.dy, 1e-4);
    }
}

// Interpolation error of a cubic spline is of fourth order: 2⁴ = 16 for twice the wavelength.
TEST(SplineImage, InterpolatesWithFourthOrder) {
  const auto worst = [](double wavelength) {
    const double k = 2 * M_PI / wavelength;
    cv::Mat image(60, 60, CV_32F);
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 60; ++x)
        image.at<float>(y, x) = static_cast<float>(100 * std::sin(k * (x + 0.3 * y)));
    const SplineImage spline(image);
    double error = 0;
    for (double x = 25; x < 33; x += 0.17)
      for (double y = 25; y < 33; y += 0.19)
        error = std::max(error, std::abs(spline.sample(x, y).value - 100 * std::sin(k * (x + 0.3 * y))));
    return error;
  };
  EXPECT_GT(worst(8) / worst(16), 13);
  EXPECT_LT(worst(8) / worst(16), 24);
}

TEST(SplineImage, KnowsItsBorderAndRefusesOtherTypes) {
  const SplineImage spline(cv::Mat(10, 12, CV_32F, cv::Scalar(7)));
  EXPECT_TRUE(spline.contains(1, 1));
  EXPECT_TRUE(spline.contains(9.99, 7.99));
  EXPECT_FALSE(spline.contains(0.99, 5));
  EXPECT_FALSE(spline.contains(10, 5));
  EXPECT_FALSE(spline.contains(5, 8));
  EXPECT_NEAR(spline.sample(9.99, 7.99).value, 7, 1e-5);
  EXPECT_THROW(SplineImage(cv::Mat(10, 10, CV_8U)), ContractError);
  EXPECT_THROW(SplineImage(cv::Mat(3, 10, CV_32F)), ContractError);
}

}  // namespace
}  // namespace rhytid::fitting
