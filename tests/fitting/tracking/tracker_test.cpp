// The tracker on synthetic footage of exactly known motion.
#include "fitting/tracking/tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "fitting/tracking/noise_floor.h"
#include "footage_folder.h"
#include "moving_skin.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

using testing::AffineMotion;
using testing::FootageFolder;
using ::testing::HasSubstr;
using testing::kHeight;
using testing::kWidth;
using testing::motion;
using testing::picture;
using testing::small_grid;
using testing::Speckle;
using testing::truth;

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
  EXPECT_LT(e.normalised, 1.2);  // 1.28 when what the fit takes of correlated noise was not allowed for
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

// Texture in stripes of 12 px: a window with some of it at one side does not tell its deformation, and held at that of the
// first frame it would move. Its neighbours tell it.
TEST(Tracker, OneSidedTextureIsDeformedAsItsNeighboursMove) {
  const Speckle skin(kWidth, kHeight, 11);
  FootageFolder folder;
  for (int f = 0; f < 10; ++f) {
    const AffineMotion m = motion(2 * f);
    cv::Mat both = picture(skin, m, 1.5, 700 + f, 0.01, 121);
    const cv::Mat strong = picture(skin, m, 1.5, 800 + f, 0.25, 90);
    for (int y = 0; y < both.rows; ++y)
      for (int x = 0; x < both.cols; ++x)
        if (std::fmod(m.backward(Vec2(x, y)).x() + 480, 48) < 12)
          both.at<uchar>(y, x) = strong.at<uchar>(y, x);
    folder.add(both);
  }
  FrameSource source = folder.source();
  const TrackerResult r = track(source, small_grid());
  const Errors e = errors_of(r.tracks, [](int f, const Vec2& X) { return truth(2 * f, X); });
  EXPECT_GT(e.count, 200);
  EXPECT_LT(e.normalised, 3.2);  // 2.6; held: 3.9. Windows that see hardly any texture keep it above 1
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
  TrackerOptions options = small_grid();
  options.redetect = false;
  const TrackerResult r = track(source, options);
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

TEST(Tracker, LostPointsAreFoundAgain) {
  FootageFolder folder;
  film_finger(&folder, false);
  TrackerOptions o = small_grid();
  o.redetect = false;
  FrameSource first = folder.source();
  const TrackerResult without = track(first, o);
  EXPECT_EQ(without.report.redetected, 0);
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
