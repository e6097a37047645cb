// The tracker on synthetic footage of exactly known motion.
#include "fitting/tracking/tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

#include "fitting/identifiability.h"
#include "fitting/track_noise.h"
#include "fitting/tracking/noise_floor.h"
#include "footage_folder.h"
#include "sim/core/error.h"
#include "speckle.h"

namespace rhytid::fitting {
namespace {

using testing::AffineMotion;
using testing::FootageFolder;
using ::testing::HasSubstr;
using testing::Speckle;

constexpr int kWidth = 200, kHeight = 160;

/// Drift, strain and rotation growing with the frame.
AffineMotion motion(int frame) {
  AffineMotion m;
  m.centre = {kWidth / 2.0, kHeight / 2.0};
  m.translation = Vec2(0.37, -0.23) * frame;
  m.gradient << 1 + 0.004 * frame, 0.002 * frame, -0.003 * frame, 1 - 0.002 * frame;
  return m;
}

cv::Mat picture(const Speckle& skin, const AffineMotion& m, double noise, unsigned seed, double gain = 1,
                double bias = 0) {
  return skin.render([&](const Vec2& x) { return m.backward(x); }, noise, seed, gain, bias);
}

TrackerOptions small_grid() {
  TrackerOptions o;
  o.seeds.seeding = Seeding::grid;
  o.seeds.grid_step_px = 14;
  o.seeds.region = {10, 10, kWidth - 20, kHeight - 20};
  return o;
}

struct Errors {
  int count = 0;
  double rms = 0;         // px per axis
  double normalised = 0;  // rms of error over predicted deviation
  double worst = 0;       // px
};

/// Errors of all ok observations after the first frame against x = truth(frame, X).
template <class Truth>
Errors errors_of(const TrackSet& set, Truth truth) {
  Errors e;
  for (const Track& t : set.tracks)
    for (std::size_t i = 1; i < t.observations.size(); ++i) {
      const Observation& o = t.observations[i];
      if (o.status != TrackStatus::ok) continue;
      const Vec2 d = o.pixel - truth(o.frame, t.observations[0].pixel);
      e.rms += d.squaredNorm();
      e.normalised += d.dot((t.shared_covariances()[i] + o.covariance).ldlt().solve(d));
      e.worst = std::max(e.worst, d.norm());
      ++e.count;
    }
  e.rms = std::sqrt(e.rms / (2 * e.count));
  e.normalised = std::sqrt(e.normalised / (2 * e.count));
  std::printf("%d observations, rms %.4f px, normalised %.3f, worst %.3f px\n", e.count, e.rms, e.normalised,
              e.worst);
  return e;
}

Vec2 truth(int frame, const Vec2& X) {
  return motion(frame).forward(X);
}

TEST(Tracker, FollowsAnAffineMotionAndKnowsItsErrors) {
  const Speckle skin(kWidth, kHeight, 1);
  FootageFolder folder;
  for (int f = 0; f < 10; ++f) folder.add(picture(skin, motion(f), 2.5, 100 + f));
  FrameSource source = folder.source();
  const TrackerResult r = track(source, small_grid());
  EXPECT_EQ(r.report.frames_asked, 10);
  EXPECT_EQ(r.report.frames_processed, 10);
  EXPECT_EQ(r.report.end, TrackerEnd::finished);
  EXPECT_GT(r.report.started, 50);
  EXPECT_EQ(r.report.unbroken, r.report.started);
  EXPECT_EQ(r.report.template_updates, 0);
  EXPECT_NEAR(r.tracks.tracks[0].observations[5].time_s, 0.2, 1e-15);
  const Errors e = errors_of(r.tracks, truth);
  EXPECT_LT(e.rms, 0.02);
  EXPECT_GT(e.normalised, 0.8);
  EXPECT_LT(e.normalised, 1.4);
}

// What the tracker says and how the fit reads it belong together: errors against the exact motion, whitened
// by the fit's noise model, have unit variance, and so have innovations, which do not remember the last
// frame.
TEST(Tracker, ErrorsAreWhiteUnderTheNoiseModelOfTheFit) {
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
TEST(Tracker, FirstCovarianceOfLateTracksIsThatOfTheirNeighbours) {
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

TEST(Tracker, WithoutNoiseOnlyRoundingIsLeft) {
  const Speckle skin(kWidth, kHeight, 2);
  FootageFolder folder;
  for (int f = 0; f < 4; ++f) folder.add(picture(skin, motion(f), 0, 0));
  FrameSource source = folder.source();
  const TrackerResult r = track(source, small_grid());
  const Errors e = errors_of(r.tracks, truth);
  EXPECT_LT(e.rms, 0.003);  // 8-bit rounding is noise of 0.29 grey
  EXPECT_LT(e.normalised, 1.5);
}

TEST(Tracker, LightingGainAndBiasDoNotMoveTracks) {
  const Speckle skin(kWidth, kHeight, 3);
  FootageFolder folder;
  const double gain[] = {1, 0.6, 1.1, 0.5}, bias[] = {0, 60, -20, 10};
  for (int f = 0; f < 4; ++f) folder.add(picture(skin, motion(f), 1.0, 200 + f, gain[f], bias[f]));
  FrameSource source = folder.source();
  const TrackerResult r = track(source, small_grid());
  EXPECT_GE(r.report.kept, 0.98 * r.report.started);
  const Errors e = errors_of(r.tracks, truth);
  EXPECT_LT(e.rms, 0.02);
  EXPECT_LT(e.normalised, 1.35);
}

// Stretch by 1.4 with a local bulge that no affine window follows: templates must be renewed. The error is
// then not noise but bias: a window reports its mean displacement, u + u'' h²/6 per axis for half size h,
// here up to 0.2 px.
TEST(Tracker, LargeDeformationRenewsTemplates) {
  const Speckle skin(kWidth, kHeight, 4);
  const Vec2 middle(kWidth / 2.0, kHeight / 2.0);
  const auto bulge = [&](double amount, const Vec2& X) -> Vec2 {
    const Vec2 d = X - middle;
    return middle + d * (1 + amount * std::exp(-d.squaredNorm() / (2 * 40.0 * 40.0)));
  };
  constexpr int kFrames = 14;
  FootageFolder folder;
  for (int f = 0; f < kFrames; ++f) {
    const double amount = 0.4 * f / (kFrames - 1);
    const auto backward = [&](const Vec2& x) {  // fixed-point iteration: a contraction for these amounts
      Vec2 X = x;
      for (int k = 0; k < 60; ++k) X += 0.6 * (x - bulge(amount, X));
      return X;
    };
    folder.add(skin.render(backward, 1.5, 300 + f));
  }
  FrameSource source = folder.source();
  const TrackerResult r = track(source, small_grid());
  EXPECT_GT(r.report.template_updates, 0);
  EXPECT_GE(r.report.kept, 0.9 * r.report.started);
  const Errors e =
      errors_of(r.tracks, [&](int f, const Vec2& X) { return bulge(0.4 * f / (kFrames - 1), X); });
  EXPECT_LT(e.rms, 0.12);
  EXPECT_LT(e.worst, 0.6);
}

// A renewed template keeps the error of the place where it was cut: one further shift for all that follows,
// and no larger errors of the frames themselves. What is stated is an upper bound: the noise of the frame the
// template is cut from moves its place one way and its alignments the other, and partly cancels.
TEST(Tracker, RenewedTemplatesShiftWhatFollows) {
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
    for (const Track& t : track(source, o).tracks.tracks) {
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

/// A dark disc with its own texture that sweeps over the skin from the left and leaves on the right.
struct Finger {
  Vec2 centre(int frame) const { return {-40 + 30.0 * frame, 80}; }
  double radius = 26;
  bool covers(int frame, const Vec2& x, double margin) const {
    return (x - centre(frame)).norm() < radius + margin;
  }
};

cv::Mat with_finger(const cv::Mat& grey, const Finger& finger, int frame, const Speckle& texture, bool red) {
  cv::Mat out;
  cv::cvtColor(grey, out, cv::COLOR_GRAY2BGR);
  for (int y = 0; y < out.rows; ++y)
    for (int x = 0; x < out.cols; ++x) {
      if (!finger.covers(frame, {x, y}, 0)) continue;
      const Vec2 own = Vec2(x, y) - finger.centre(frame) + Vec2(100, 80);
      const auto v = cv::saturate_cast<uchar>(0.7 * texture.value(own) - 10);
      out.at<cv::Vec3b>(y, x) = red ? cv::Vec3b(20, 20, 220) : cv::Vec3b(v, v, v);
    }
  return out;
}

constexpr int kFingerFrames = 10;

void film_finger(FootageFolder* folder, bool red) {
  const Speckle skin(kWidth, kHeight, 5), texture(kWidth, kHeight, 6);
  for (int f = 0; f < kFingerFrames; ++f) {
    AffineMotion m;
    m.translation = Vec2(0.2, 0.1) * f;
    folder->add(with_finger(picture(skin, m, 1.0, 400 + f), Finger{}, f, texture, red));
  }
}

Vec2 finger_truth(int frame, const Vec2& X) {
  return X + Vec2(0.2, 0.1) * frame;
}

TEST(Tracker, CoveredTracksAreLostAndNeverWrong) {
  FootageFolder folder;
  film_finger(&folder, false);
  FrameSource source = folder.source();
  const TrackerResult r = track(source, small_grid());
  const Errors e = errors_of(r.tracks, finger_truth);
  EXPECT_LT(e.worst, 0.5);  // nothing rides along with the finger, which moves 30 px per frame
  int covered = 0, clear = 0, clear_ok = 0;
  for (const Track& t : r.tracks.tracks) {
    bool ever_near = false;
    for (const Observation& o : t.observations) {
      const Vec2 x = finger_truth(o.frame, t.observations[0].pixel);
      if (Finger{}.covers(o.frame, x, -3)) {
        ++covered;
        EXPECT_NE(o.status, TrackStatus::ok) << "track " << t.id << " frame " << o.frame;
      }
      ever_near = ever_near || Finger{}.covers(o.frame, x, 20);
    }
    if (!ever_near) {
      ++clear;
      clear_ok += t.observations.back().status == TrackStatus::ok;
    }
  }
  EXPECT_GT(covered, 20);
  EXPECT_GT(clear, 10);
  EXPECT_EQ(clear_ok, clear);
}

TEST(Tracker, LostPointsAreFoundAgainWhenAsked) {
  FootageFolder folder;
  film_finger(&folder, false);
  TrackerOptions o = small_grid();
  FrameSource first = folder.source();
  const TrackerResult without = track(first, o);
  o.redetect = true;
  FrameSource second = folder.source();
  const TrackerResult with = track(second, o);
  EXPECT_GT(with.report.redetected, 5);
  EXPECT_GT(with.report.kept, without.report.kept);
  EXPECT_GE(with.report.kept, 0.95 * with.report.started);
  const Errors e = errors_of(with.tracks, finger_truth);
  EXPECT_LT(e.worst, 0.5);
}

TEST(Tracker, OccludedByColour) {
  FootageFolder folder;
  film_finger(&folder, true);
  TrackerOptions o = small_grid();
  o.occluder.colour = OccluderColour{{170, 150, 100}, {10, 255, 255}};  // red: hue wraps
  FrameSource source = folder.source();
  const TrackerResult r = track(source, o);
  int covered = 0, said = 0;
  for (const Track& t : r.tracks.tracks)
    for (const Observation& ob : t.observations)
      if (Finger{}.covers(ob.frame, finger_truth(ob.frame, t.observations[0].pixel), 0)) {
        ++covered;
        said += ob.status == TrackStatus::occluded;
      }
  EXPECT_GT(covered, 20);
  EXPECT_GE(said, 0.9 * covered);
  EXPECT_LT(errors_of(r.tracks, finger_truth).worst, 0.3);
}

TEST(Tracker, OccludedByPolygon) {
  const Speckle skin(kWidth, kHeight, 7);
  FootageFolder folder;
  for (int f = 0; f < 2; ++f) folder.add(picture(skin, motion(f), 1, f));
  TrackerOptions o = small_grid();
  o.occluder.polygons = {{{0, 0}, {100, 0}, {100, 160}, {0, 160}}};
  FrameSource source = folder.source();
  const TrackerResult r = track(source, o);
  ASSERT_FALSE(r.tracks.tracks.empty());
  for (const Track& t : r.tracks.tracks) EXPECT_GT(t.observations[0].pixel.x(), 100);
}

TEST(Tracker, StillFootageGivesTheNoiseFloor) {
  const Speckle skin(kWidth, kHeight, 8);
  FootageFolder folder;
  for (int f = 0; f < 8; ++f) folder.add(picture(skin, {}, 3, 500 + f));
  FrameSource source = folder.source();
  const TrackerResult r = track(source, small_grid());
  const NoiseFloor floor = measure_noise_floor(r.tracks, 0, 7, false);
  EXPECT_EQ(floor.tracks, r.report.started);
  EXPECT_GT(floor.normalised, 0.8);
  EXPECT_LT(floor.normalised, 1.25);
  // Template noise is common to all frames: scatter about the mean and drift share the variance about
  // equally.
  EXPECT_NEAR(floor.drift_px / floor.scatter_px, 1, 0.35);
  EXPECT_NEAR(std::hypot(floor.scatter_px, floor.drift_px) / floor.predicted_px, 1, 0.25);
}

TEST(Tracker, ResultDoesNotDependOnThreads) {
  FootageFolder folder;
  film_finger(&folder, false);
  TrackerOptions o;
  o.redetect = true;
  o.seeds.max_tracks = 60;
  const int before = cv::getNumThreads();
  std::map<int, TrackSet> sets;
  for (int threads : {1, 4}) {
    cv::setNumThreads(threads);
    FrameSource source = folder.source();
    sets[threads] = track(source, o).tracks;
  }
  cv::setNumThreads(before);
  ASSERT_EQ(sets[1].tracks.size(), sets[4].tracks.size());
  for (std::size_t t = 0; t < sets[1].tracks.size(); ++t)
    for (std::size_t i = 0; i < sets[1].tracks[t].observations.size(); ++i) {
      const Observation &a = sets[1].tracks[t].observations[i], &b = sets[4].tracks[t].observations[i];
      ASSERT_EQ(a.status, b.status);
      ASSERT_EQ(a.pixel, b.pixel);
      ASSERT_EQ(a.covariance, b.covariance);
    }
}

TEST(Tracker, ReportsHowFarItCame) {
  const Speckle skin(kWidth, kHeight, 9);
  FootageFolder folder;
  for (int f = 0; f < 3; ++f) folder.add(picture(skin, motion(f), 1, f));
  FrameSourceOptions longer;
  longer.path = folder.file("f_%03d.png");
  longer.last = 7;
  FrameSource early(longer);
  const TrackerReport report = track(early, small_grid()).report;
  EXPECT_EQ(report.frames_asked, 8);
  EXPECT_EQ(report.frames_processed, 3);
  EXPECT_EQ(report.end, TrackerEnd::source_ended_early);
  EXPECT_THAT(summary(report), HasSubstr("3 of 8 frames"));

  TrackerOptions o = small_grid();
  o.progress = [](const FrameCounts&, int processed, int asked) { return processed < 2 && asked == 3; };
  FrameSource stopped = folder.source();
  const TrackerReport second = track(stopped, o).report;
  EXPECT_EQ(second.frames_processed, 2);
  EXPECT_EQ(second.end, TrackerEnd::interrupted);
}

TEST(Tracker, RefusesBadInput) {
  FootageFolder folder;
  folder.add(cv::Mat(100, 120, CV_8U, cv::Scalar(90)));
  const auto refusal = [&](TrackerOptions o) -> std::string {
    try {
      FrameSource source = folder.source();
      track(source, o);
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal({}), HasSubstr("no point with enough texture"));
  TrackerOptions o;
  o.window_px = 20;
  EXPECT_THAT(refusal(o), HasSubstr("window_px"));
  o = {};
  o.seeds.region = {50, 50, 100, 20};
  EXPECT_THAT(refusal(o), HasSubstr("region"));
  o = {};
  o.seeds.region_mask = cv::Mat(10, 10, CV_8U, cv::Scalar(255));
  EXPECT_THAT(refusal(o), HasSubstr("region_mask"));
  o = {};
  o.window_px = 101;
  EXPECT_THAT(refusal(o), HasSubstr("window margin"));
}

}  // namespace
}  // namespace rhytid::fitting
