// Blur by motion: moments of lines, and what two pictures lack of each other's blur.
#include "fitting/tracking/motion_blur.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

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
  const auto place = [](double t) {
    return Vec2(0.2 * (t + 3) * (t + 3) * (t + 3), 0);
  };  // acceleration 1.2 (t + 3)
  Track track;
  for (int f = 0; f < 8; ++f) {
    Observation o;
    o.frame = f, o.status = TrackStatus::ok;
    o.pixel = place(f) + Vec2(1.2 * (f + 3) / 24, 0);
    track.observations.push_back(o);
  }
  remove_acceleration(1, &track);
  // Against its first: that one's acceleration stays, with the material point.
  for (int f = 0; f < 8; ++f)
    EXPECT_NEAR(track.observations[f].pixel.x(), place(f).x() + 3.6 / 24, 1e-12) << f;
}

/// The track of a point at `places`, one per frame; seen where they are finite.
Track track_of(const std::vector<double>& places) {
  Track track;
  for (std::size_t f = 0; f < places.size(); ++f) {
    Observation o;
    o.frame = static_cast<int>(f);
    o.status = std::isfinite(places[f]) ? TrackStatus::ok : TrackStatus::lost;
    o.pixel = Vec2(places[f], -0.5 * places[f]);
    o.covariance = 1e-4 * Eigen::Matrix2d::Identity();
    track.observations.push_back(o);
  }
  return track;
}

/// x(t) of a point that moves at `speed` from `from` to `to` and rests else, and its mean over an exposure e about t.
double pushed(double t, double from, double to, double speed) {
  return speed * (std::clamp(t, from, to) - from);
}
double mean_of_exposure(double t, double e, double from, double to, double speed) {
  constexpr int kParts = 2000;
  double sum = 0;
  for (int k = 0; k < kParts; ++k)
    sum += pushed(t + e * ((k + 0.5) / kParts - 0.5), from, to, speed) / kParts;
  return sum;
}

// Skin that rests, is pushed and rests again, from whatever moment on: what speed's jumps do stays in their own frames and is in
// the covariances there; frames at rest are as they were.
TEST(MotionBlur, JumpsOfSpeedStayInTheirFrames) {
  for (const double e : {0.5, 1.0}) {
    double sum = 0;
    int count = 0;
    for (double from = 1; from < 3; from += 0.05) {
      const double to = from + 2.4, speed = 8;
      std::vector<double> places;
      for (int f = 0; f < 10; ++f) places.push_back(mean_of_exposure(f, e, from, to, speed));
      Track track = track_of(places);
      remove_acceleration(e, &track);
      for (int f = 0; f < 10; ++f) {
        const Observation& o = track.observations[static_cast<std::size_t>(f)];
        const double error = o.pixel.x() - pushed(f, from, to, speed);
        const double variance = o.covariance(0, 0);
        const double reach = 1 + e / 2;  // of second differences of means
        if (f + reach < from || f > to + reach) {
          EXPECT_NEAR(error, 0, 1e-9) << e << ", " << from << ", " << f;
          if (f + reach + 1 < from || f > to + reach + 1) {
            EXPECT_NEAR(variance, 1e-4, 1e-12) << e << ", " << from << ", " << f;
          }
        } else if (std::fabs(f - from) < 1 || std::fabs(f - to) < 1) {
          sum += error * error / variance;
          ++count;
        }
      }
    }
    EXPECT_GT(sum / count, 0.2) << e;  // neither hidden
    EXPECT_LT(sum / count, 1.5) << e;  // nor drowned
  }
}

TEST(MotionBlur, OneJumpBesideTheFirstFrameOrAGapMovesNoOtherFrame) {
  constexpr double kGap = std::numeric_limits<double>::quiet_NaN();
  Track starts = track_of({0, 4, 4, 4, 4, 4});  // moved and stopped at once
  remove_acceleration(1, &starts);
  for (int f = 3; f < 6; ++f) EXPECT_EQ(starts.observations[f].pixel.x(), 4) << f;
  EXPECT_GT(starts.observations[0].covariance(0, 0),
            1e-4);  // which may have been in the first frame, for all that is known
  Track broken = track_of({0, 0, 0, 0, kGap, 9, 9, 9, 13, kGap, 17});
  remove_acceleration(1, &broken);
  for (const int f : {1, 2, 3, 5, 6}) EXPECT_EQ(broken.observations[f].pixel.x(), f < 4 ? 0 : 9) << f;
  EXPECT_EQ(broken.observations[8].pixel.x(), 13);
  EXPECT_GT(broken.observations[8].covariance(0, 0), 1e-3);
  EXPECT_EQ(broken.observations[10].pixel.x(), 17);
  EXPECT_EQ(broken.observations[10].covariance(0, 0), 1e-4);
}

// A point that rests in its first frame was not blurred there, however fast it moves in the next.
TEST(MotionBlur, RestIsNotExtrapolatedIntoMotion) {
  Follower f;
  f.has_first_template = true;
  f.track = track_of({0, 0, 4, 8, 12});
  const std::optional<Motions> pushed = motions_of(f, Vec2(16, -8));
  ASSERT_TRUE(pushed);
  EXPECT_EQ(pushed->first, Vec2::Zero());
  EXPECT_EQ(pushed->now, Vec2(4, -2));
  f.track = track_of({0, 4, 9, 15, 15});
  const std::optional<Motions> stopped = motions_of(f, Vec2(15, -7.5));
  ASSERT_TRUE(stopped);
  EXPECT_EQ(stopped->first, Vec2(3.5, -1.75));
  EXPECT_EQ(stopped->now, Vec2::Zero());
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
