// Points that are looked for: found where they are, refused where something else looks alike, and tracks that stray.
#include "fitting/tracking/redetection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "moving_skin.h"

namespace rhytid::fitting {
namespace {

using testing::AffineMotion;
using testing::kHeight;
using testing::kWidth;
using testing::picture;
using testing::Speckle;

const Vec2 kSeed(90, 80);

SplineImage smoothed(const cv::Mat& grey) {
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {0, 0}, 0.8);
  return SplineImage(smooth);
}

/// A lost point of `first` looked for in `now`, expected `off` px from where it was.
Measurement looked_for(const cv::Mat& first, const cv::Mat& now, const Vec2& off,
                       const TrackerOptions& options = {}) {
  const SplineImage before = smoothed(first), image = smoothed(now);
  const cv::Mat no_mask;
  const FrameView view{&image, &before, &before, &no_mask, 0.1};
  Follower f;
  f.seed = f.warp.centre = kSeed;
  f.active = false;
  f.patch = cut_template(before, kSeed, 10);
  f.baseline = f.residual = 1;
  return redetect(f, {kSeed + off, Eigen::Matrix2d::Identity()}, view, options);
}

TEST(Redetection, APointIsFoundWhereItIs) {
  const Speckle skin(kWidth, kHeight, 21);
  AffineMotion moved;
  moved.translation = Vec2(3.3, -1.7);
  const Measurement m = looked_for(picture(skin, {}, 1.5, 1), picture(skin, moved, 1.5, 2), Vec2(0, 2));
  ASSERT_EQ(m.refusal, Refusal::none);
  EXPECT_LT((m.alignment.warp.centre - kSeed - moved.translation).norm(), 0.1);
}

// What stands at the point has been brought there from 5 px beside it: the template is found again, but its window is
// found beside the seed.
TEST(Redetection, WhatLeadsBackElsewhereIsRefused) {
  const Speckle skin(kWidth, kHeight, 22), other(kWidth, kHeight, 23);
  cv::Mat first = picture(skin, {}, 1, 1);
  // Texture with a period of 5 px about the seed, faded by 20 % per period: a window looks like its neighbour.
  for (int y = 60; y <= 100; ++y)
    for (int x = 60; x <= 120; ++x)
      first.at<uchar>(y, x) = cv::saturate_cast<uchar>(
          128 + 60 * std::cos(2 * std::numbers::pi * x / 5) * std::cos(2 * std::numbers::pi * y / 40) +
          0.06 * (x - 90) * (y - 80));
  cv::Mat now = other.render([](const Vec2& x) { return x; }, 1, 3);
  // Only what was 5 px to the right is there, and it stands where the seed was.
  first(cv::Rect(80, 65, 31, 31)).copyTo(now(cv::Rect(75, 65, 31, 31)));
  TrackerOptions any_return;
  any_return.redetect_max_return_px = 100;
  EXPECT_EQ(looked_for(first, now, Vec2::Zero(), any_return).refusal, Refusal::none);
  EXPECT_EQ(looked_for(first, now, Vec2::Zero()).refusal, Refusal::forward_backward);
}

TEST(Redetection, TexturelessSkinIsNotFound) {
  const Speckle skin(kWidth, kHeight, 24);
  const cv::Mat flat(kHeight, kWidth, CV_8U, cv::Scalar(120));
  EXPECT_NE(looked_for(picture(skin, {}, 1, 1), flat, Vec2::Zero()).refusal, Refusal::none);
}

TEST(Redetection, NothingIsFoundBeyondThePicture) {
  const Speckle skin(kWidth, kHeight, 25);
  EXPECT_EQ(looked_for(picture(skin, {}, 1, 1), picture(skin, {}, 1, 2), Vec2(-88, 0)).refusal,
            Refusal::outside);
}

TEST(Strays, OnlyWhatFitsBadlyAndMovesUnlikeItsNeighbours) {
  std::vector<std::pair<Vec2, Vec2>> others;
  for (int i = 0; i < 8; ++i) others.emplace_back(Vec2(10 * i, 5), Vec2(1 + 0.1 * i, 0.5));
  Follower f;
  f.warp.centre = Vec2(35, 8);
  Alignment a;
  const auto is_stray = [&](double correlation, const Vec2& motion) {
    a.correlation = correlation;
    a.warp.centre = f.warp.centre + motion;
    return strays(f, a, others, others.size());
  };
  EXPECT_TRUE(is_stray(0.8, Vec2(20, 0)));
  EXPECT_FALSE(is_stray(0.8, Vec2(2, 1)));
  EXPECT_FALSE(is_stray(0.97, Vec2(20, 0)));
  // Neighbours that differ by much themselves say little.
  for (std::size_t i = 0; i < 8; ++i) others[i].second.x() = 6 * static_cast<double>(i % 4);
  EXPECT_FALSE(is_stray(0.8, Vec2(20, 0)));
  others.resize(3);
  EXPECT_FALSE(is_stray(0.8, Vec2(80, 0)));
  // It is no neighbour of its own: with itself in the list there are three others still.
  others.emplace_back(f.warp.centre, Vec2(80, 0));
  a.correlation = 0.8, a.warp.centre = f.warp.centre + Vec2(80, 0);
  EXPECT_FALSE(strays(f, a, others, 3));
  EXPECT_TRUE(strays(f, a, others, 4));
}

}  // namespace
}  // namespace rhytid::fitting
