// Blur by motion: moments of lines, and what two pictures lack of each other's blur.
#include "fitting/tracking/motion_blur.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace rhytid::fitting {
namespace {

TEST(MotionBlur, WhatStoodStillIsBlurredByTheWholeLine) {
  const RelativeBlur blur = relative_blur(Vec2::Zero(), Vec2(4, 3), Eigen::Matrix2d::Identity(), 0.5);
  EXPECT_NEAR(blur.of_template.norm(), 2.5, 1e-12);
  EXPECT_NEAR(std::abs(blur.of_template.dot(Vec2(0.8, 0.6))), 2.5, 1e-12);
  EXPECT_EQ(blur.of_image, Vec2::Zero());
}

TEST(MotionBlur, EqualMotionsNeedNoBlurAndOthersHaveEqualMomentsAfterIt) {
  EXPECT_EQ(relative_blur(Vec2(5, 1), Vec2(-5, -1), Eigen::Matrix2d::Identity(), 1).longest(), 0);
  Eigen::Matrix2d gradient;
  gradient << 1.1, 0.1, -0.05, 0.95;
  const Vec2 first(5, 1), now(-2, 4);
  const RelativeBlur blur = relative_blur(first, now, gradient, 0.8);
  const Vec2 w = 0.8 * gradient.inverse() * now, V = 0.8 * first, image = gradient.inverse() * blur.of_image;
  const Eigen::Matrix2d difference = V * V.transpose() + blur.of_template * blur.of_template.transpose() -
                                     w * w.transpose() - image * image.transpose();
  EXPECT_LT(difference.norm(), 1e-12);
}

// x² averaged along a line of length l in x grows by l²/12, whatever the direction and place of its points.
TEST(MotionBlur, LinesHaveTheirMoments) {
  cv::Mat grey(40, 40, CV_32F);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x)
      grey.at<float>(y, x) = static_cast<float>(0.1 * (x - 20) * (x - 20) + 0.2 * y);
  const SplineImage image(grey);
  const Vec2 line(3.3, -2.1);
  const SplineImage part = image.averaged({8, 8, 24, 24}, line);
  EXPECT_TRUE(part.contains(15.3, 17.8));
  EXPECT_FALSE(part.contains(5, 17));
  EXPECT_NEAR(part.sample(15.3, 17.8).value - image.sample(15.3, 17.8).value, 0.1 * 3.3 * 3.3 / 12, 5e-3);
  EXPECT_NEAR(part.sample(15.3, 17.8).dx, image.sample(15.3, 17.8).dx, 1e-4);
}

TEST(MotionBlur, TheMeanOfAnAcceleratedExposureIsPutRight) {
  Track track;
  for (int f = 0; f < 8; ++f) {
    Observation o;
    o.frame = f, o.status = TrackStatus::ok;
    const auto place = [](double t) { return Vec2(0.2 * t * t * t, 0); };  // acceleration 1.2 t
    o.pixel = place(f) + Vec2(1.2 * f / 24, 0);
    track.observations.push_back(o);
  }
  remove_acceleration(1, &track);
  for (int f = 1; f < 8; ++f) EXPECT_NEAR(track.observations[f].pixel.x(), 0.2 * f * f * f, 1e-12) << f;
}

TEST(MotionBlur, TheShutterNeedsEnoughWindowsThatTell) {
  Shutter shutter;
  for (int i = 0; i < 11; ++i) shutter.add({3, 2, 1, 2, 3});
  EXPECT_EQ(shutter.exposure(), 0);
  shutter.add({3, 2, 1, 2, 3});
  EXPECT_NEAR(shutter.exposure(), 0.5, 1e-12);
  Shutter closed;
  for (int i = 0; i < 50; ++i) closed.add({1, 0.99, 1.5, 2, 3});
  EXPECT_EQ(closed.exposure(), 0);  // a hundredth is no reason
}

}  // namespace
}  // namespace rhytid::fitting
