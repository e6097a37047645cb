// Covariances of tracks, and the noise model by which the fit reads them, against errors that are known exactly.
#include "fitting/track_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "fitting/identifiability.h"
#include "footage_folder.h"
#include "moving_skin.h"

namespace rhytid::fitting {
namespace {

using testing::AffineMotion;
using testing::FootageFolder;
using testing::kHeight;
using testing::kWidth;
using testing::motion;
using testing::picture;
using testing::small_grid;
using testing::Speckle;
using testing::truth;

// What the tracker says and how the fit reads it belong together: errors against the exact motion, whitened
// by the fit's noise model, have unit variance, and so have innovations, which do not remember the last
// frame.
TEST(TrackerNoise, ErrorsAreWhiteUnderTheNoiseModelOfTheFit) {
  for (const double noise : {1.5, 4.0}) {
    const Speckle skin(kWidth, kHeight, 31);
    FootageFolder folder;
    for (int f = 0; f < 10; ++f) folder.add(picture(skin, motion(f), noise, 600 + f));
    FrameSource source = folder.source();
    const TrackerResult r = track(source, small_grid());
    double squares = 0, own = 0;
    int numbers = 0;
    std::vector<MatrixXd> innovations;
    std::vector<std::vector<int>> frames;
    for (const Track& t : r.tracks.tracks) {
      std::vector<Eigen::Matrix2d> covariances;
      std::vector<int> seen;
      VectorXd errors(2 * (t.observations.size() - 1));
      for (std::size_t i = 1; i < t.observations.size(); ++i) {
        const Observation& o = t.observations[i];
        ASSERT_EQ(o.status, TrackStatus::ok);
        errors.segment<2>(2 * (i - 1)) = o.pixel - truth(o.frame, t.observations[0].pixel);
        covariances.push_back(o.covariance);
        seen.push_back(o.frame);
      }
      const TrackNoise model(t.observations[0].covariance, covariances, 0);
      const auto at = model.evaluate(errors);
      squares += 2 * at.cost;
      numbers += static_cast<int>(errors.size());
      innovations.push_back(model.innovations(errors, at));
      frames.push_back(seen);
      // The frames' own share alone: scatter about the track's mean, which the common share does not enter.
      const auto n = static_cast<double>(covariances.size());
      for (int axis = 0; axis < 2; ++axis) {
        double mean = 0, variance = 0;
        for (Eigen::Index i = axis; i < errors.size(); i += 2) mean += errors[i] / n;
        for (Eigen::Index i = axis; i < errors.size(); i += 2)
          variance += std::pow(errors[i] - mean, 2) / (n - 1);
        own += variance / covariances[0](axis, axis) / (2 * static_cast<double>(r.tracks.tracks.size()));
      }
    }
    const double chi = squares / numbers, rho = lag_one_autocorrelation(innovations, frames);
    std::printf("noise %.1f: reduced chi-square %.3f, own variance ratio %.3f, lag-1 %.3f\n", noise, chi, own,
                rho);
    EXPECT_GT(chi, 0.75);
    EXPECT_LT(chi, 1.7);
    EXPECT_GT(own, 0.75);
    EXPECT_LT(own, 1.7);
    EXPECT_LT(std::fabs(rho), 0.25);
  }
}

// Points that were covered right after the first frame know their first error as well as the others.
TEST(TrackerNoise, FirstCovarianceOfLateTracksIsThatOfTheirNeighbours) {
  const Speckle skin(kWidth, kHeight, 32);
  FootageFolder folder;
  for (int f = 0; f < 4; ++f) folder.add(picture(skin, {}, 2.5, 700 + f));
  TrackerOptions o = small_grid();
  o.redetect = true;
  o.mask = [](const Frame& frame) {  // the left half in frame 1, the upper right corner from then on
    cv::Mat mask(kHeight, kWidth, CV_8U, cv::Scalar(0));
    if (frame.index == 1) mask(cv::Rect(0, 0, 90, kHeight)) = 255;
    if (frame.index >= 1) mask(cv::Rect(140, 0, 60, 50)) = 255;
    return mask;
  };
  FrameSource source = folder.source();
  const TrackerResult r = track(source, o);
  std::map<int, std::vector<double>> deviations;  // by the first frame in which they were seen again
  for (const Track& t : r.tracks.tracks) {
    int first = 0;
    for (const Observation& ob : t.observations)
      if (first == 0 && ob.frame > 0 && ob.status == TrackStatus::ok) first = ob.frame;
    deviations[first].push_back(std::sqrt(t.observations[0].covariance.trace() / 2));
  }
  for (const int first : {0, 1, 2}) {
    ASSERT_GT(deviations[first].size(), 3u) << first;
    std::nth_element(deviations[first].begin(), deviations[first].begin() + deviations[first].size() / 2,
                     deviations[first].end());
  }
  const auto median = [&](int first) { return deviations[first][deviations[first].size() / 2]; };
  std::printf("first deviation: seen at once %.4f, later %.4f, never %.4f px\n", median(1), median(2),
              median(0));
  EXPECT_NEAR(median(2) / median(1), 1, 0.3);
  EXPECT_NEAR(median(0) / median(1), 1, 0.4);
}

// A renewed template keeps the error of the place where it was cut: one further shift for all that follows,
// and no larger errors of the frames themselves. What is stated is an upper bound: the noise of the frame the
// template is cut from moves its place one way and its alignments the other, and partly cancels.
TEST(TrackerNoise, RenewedTemplatesShiftWhatFollows) {
  constexpr int kFrames = 14;
  const auto stretch = [](int f) {  // until frame 6, then at rest
    AffineMotion m;
    m.centre = {kWidth / 2.0, kHeight / 2.0};
    const double s = std::min(f, 6) / 6.0;
    m.gradient << 1 + 0.5 * s, 0.1 * s, 0, 1 - 0.2 * s;
    return m;
  };
  TrackerOptions o = small_grid();
  o.seeds.region = {30, 30, kWidth - 60, kHeight - 60};
  double squares = 0, jumps = 0, of_frames = 0, stated = 0, own_before = 0, own_after = 0;
  int numbers = 0, renewed = 0;
  std::vector<MatrixXd> innovations;
  std::vector<std::vector<int>> frames;
  for (const unsigned seed : {40u, 41u}) {
    const Speckle skin(kWidth, kHeight, seed);
    FootageFolder folder;
    for (int f = 0; f < kFrames; ++f) folder.add(picture(skin, stretch(f), 2.0, 1000 * seed + f));
    FrameSource source = folder.source();
    const TrackerResult result = track(source, o);
    EXPECT_EQ(result.report.exposure,
              0);  // what strain does to the smoothing of the pictures is no blur of motion
    for (const Track& t : result.tracks.tracks) {
      std::vector<const Observation*> used;
      std::vector<int> seen;
      int cut = -1;
      VectorXd errors(0);
      for (const Observation& observed : t.observations) {
        if (observed.frame == 0 || observed.status != TrackStatus::ok) continue;
        if (observed.renewed) cut = cut < 0 ? static_cast<int>(used.size()) : 0;
        used.push_back(&observed);
        seen.push_back(observed.frame);
        errors.conservativeResize(2 * used.size());
        errors.tail<2>() = observed.pixel - stretch(observed.frame).forward(t.observations[0].pixel);
      }
      if (cut <= 0) continue;  // not renewed, or more than once
      ++renewed;
      const TrackNoise model(t, used, 1e-6, 0);
      ASSERT_EQ(model.num_shifts(), 2);
      EXPECT_EQ(model.shift_of(cut - 1), 0);
      EXPECT_EQ(model.shift_of(cut), 1);
      const auto at = model.evaluate(errors);
      squares += 2 * at.cost;
      numbers += static_cast<int>(errors.size());
      innovations.push_back(model.innovations(errors, at));
      frames.push_back(seen);
      // The mean error after the renewal against that before it.
      const auto n = static_cast<int>(used.size());
      Vec2 jump = Vec2::Zero();
      double own[2] = {0, 0};
      for (int i = 0; i < n; ++i) {
        const double count = i < cut ? cut : n - cut;
        jump += (i < cut ? -1 : 1) * errors.segment<2>(2 * i) / count;
        own[i < cut ? 0 : 1] += used[i]->covariance.trace() / count;
      }
      jumps += jump.squaredNorm();
      of_frames += own[0] / cut + own[1] / (n - cut);
      stated += used[cut - 1]->covariance.trace();
      own_before += own[0], own_after += own[1];
    }
  }
  const double chi = squares / numbers, rho = lag_one_autocorrelation(innovations, frames);
  std::printf("%d renewed: reduced chi-square %.3f, lag-1 %.3f, shift %.2f of the variance stated\n", renewed,
              chi, rho, (jumps - of_frames) / stated);
  EXPECT_GT(renewed, 60);
  EXPECT_GT(chi, 0.75);
  EXPECT_LT(chi, 1.6);
  EXPECT_LT(std::fabs(rho), 0.25);
  EXPECT_LT((jumps - of_frames) / stated, 1);
  EXPECT_GT((jumps - of_frames) / stated, 0.1);
  EXPECT_NEAR(own_after / own_before, 1, 0.5);
}

}  // namespace
}  // namespace rhytid::fitting
