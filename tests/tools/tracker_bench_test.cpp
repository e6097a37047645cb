// bench tracker: that the truth of its films is true, what its shutter and lamp do, and what the tracker owes to mends.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "sim/output/atomic_file.h"
#include "tests/support/temporary_folder.h"
#include "tools/bench/filming.h"

namespace rhytid::tools {
namespace {

const cv::Size kSize(360, 270);
const cv::Rect kInner(60, 60, 240, 150);

const Filming& filming(const std::string& name) {
  const auto& all = filmings();
  return *std::find_if(all.begin(), all.end(), [&name](const Filming& f) { return f.name == name; });
}

std::unique_ptr<FilmedSkin> speckle(int frames) {
  return make_plane_skin(speckle_texture(kSize, 3), 2, kSize, frames, kInner);
}

TrackingScore score(const std::string& name, int frames = 8, std::optional<double> exposure = {}) {
  fitting::TrackerOptions options;
  options.exposure = exposure;
  options.seeds.min_distance_px = 12;
  options.seeds.max_tracks = 60;
  // What lies in the folder stays, and nothing of the film does.
  const test::TemporaryFolder folder;
  write_file(folder / "film", "mine");
  const TrackingScore s = score_filming(*speckle(frames), filming(name), options, 4, folder.path());
  EXPECT_EQ(folder.num_files(), 1u);
  EXPECT_EQ(read_file(folder / "film"), "mine");
  std::printf("%s: kept %.2f, rms %.4f px, sigma %.4f px, normalised %.2f, gross %d, jitter %.4f, %s\n",
              name.c_str(), s.kept, s.rms_px, s.sigma_px, s.normalised, s.gross, s.jitter_px,
              refusals_text(s).c_str());
  return s;
}

TEST(Filming, MotionsAreInverted) {
  const HeadRoll head{.centre = {100, 80}, .shift_px = 16, .turn = 0.1, .zoom = 0.04, .swipe_px = 9};
  const Pull pull{.centre = {90, 100}, .frames = 7};
  for (const double t : {-0.5, 0.0, 3.3, 7.0})
    for (const Vec2& X : {Vec2(20, 30), Vec2(150, 90)}) {
      EXPECT_LT((head.backward(head.forward(X, t), t) - X).norm(), 1e-12);
      EXPECT_LT((pull.backward(pull.forward(X, t), t) - X).norm(), 1e-10);
    }
  EXPECT_GT((pull.forward(pull.centre, 7) - pull.centre).norm(), 5.9);
}

/// Grey levels of a spot whose light falls off as a Gaussian, variance 100 px².
cv::Mat bright_spot() {
  cv::Mat spot(400, 480, CV_32F);
  for (int y = 0; y < spot.rows; ++y)
    for (int x = 0; x < spot.cols; ++x)
      spot.at<float>(y, x) = static_cast<float>(
          255 * std::pow(std::exp(-((x - 240.) * (x - 240.) + (y - 200.) * (y - 200.)) / 200.), 1 / kGamma));
  return spot;
}

/// Centre of mass of a bright spot.
Vec2 centroid(const cv::Mat& levels) {
  cv::Mat light;
  cv::pow(levels / 255, kGamma, light);
  const cv::Moments m = cv::moments(light);
  return {m.m10 / m.m00, m.m01 / m.m00};
}

// The time of a frame is the middle of its exposure, whatever its length: an even motion puts the mean there.
TEST(Filming, TimeIsTheMiddleOfTheExposure) {
  const auto skin = make_plane_skin(bright_spot(), 2, kSize, 9, kInner);
  Filming f = filming("head_5_open_1");
  f.head.turn = f.head.zoom = 0;
  f.head.period = 1000;  // even, but for the pull
  f.head.shift_px = 800;
  const Vec2 middle(kSize.width / 2., kSize.height / 2.);
  HeadRoll head = f.head;
  head.centre = middle;
  for (const int frame : {0, 4}) {
    const Vec2 truth = skin->path(middle, head)[static_cast<std::size_t>(frame)];
    EXPECT_LT((centroid(filmed_levels(*skin, f, frame)) - truth).norm(), 0.03) << frame;
  }
  const Vec2 speed = skin->path(middle, head)[5] - skin->path(middle, head)[4];
  EXPECT_GT(speed.norm(), 5);  // taken at the beginning of the exposure it would be off by half of this
}

/// Mean square of the places of a bright spot's light along x, less that of its centre.
double spread(const cv::Mat& levels) {
  cv::Mat light;
  cv::pow(levels / 255, kGamma, light);
  const cv::Moments m = cv::moments(light);
  return m.mu20 / m.m00;
}

// A point that moves by v draws a line of e v, whose mean square is e²v²/12.
TEST(Filming, LinesHaveTheirLength) {
  const auto skin = make_plane_skin(bright_spot(), 2, kSize, 9, kInner);
  Filming f = filming("head_5_open_1");
  f.head.turn = f.head.zoom = 0;
  f.head.period = 1000;
  f.head.shift_px = 1500;
  f.exposure = 0;
  const double sharp = spread(filmed_levels(*skin, f, 4));
  HeadRoll head = f.head;
  const Vec2 middle(kSize.width / 2., kSize.height / 2.);
  head.centre = middle;
  const auto path = skin->path(middle, head);
  const double v = 0.5 * (path[5].x() - path[3].x());
  ASSERT_GT(v, 8);
  for (const double e : {0.25, 0.5, 1.0}) {
    f.exposure = e;
    EXPECT_NEAR((spread(filmed_levels(*skin, f, 4)) - sharp) / (e * e * v * v / 12), 1, 0.05) << e;
  }
}

TEST(TrackerBench, PlainFootageHasTheErrorsThatAreStated) {
  const TrackingScore s = score("plain");
  EXPECT_EQ(s.kept, 1);
  EXPECT_EQ(s.observations, s.expected);
  EXPECT_EQ(s.off_skin, 0);
  EXPECT_LT(s.rms_px, 0.03);
  EXPECT_GT(s.normalised, 0.8);
  EXPECT_LT(s.normalised, 1.22);
  EXPECT_EQ(score("plain").rms_px, s.rms_px);  // seeded
}

// Three times the error of plain footage, and three of ten tracks refused, before the slope of the light was fitted.
TEST(TrackerBench, LightFromOneSideDoesNotMoveTracks) {
  const double plain = score("plain").rms_px;
  for (const char* name : {"strong_side_light", "gloss", "soft_shadow"}) {
    const TrackingScore s = score(name, 16);
    EXPECT_GE(s.kept, 0.95) << name;
    EXPECT_LT(s.rms_px, 2 * plain) << name;
    EXPECT_LT(s.normalised, 1.35) << name;
    EXPECT_EQ(s.gross, 0) << name;
  }
}

// Blocks are moved by rounded vectors, which no residual shows: 4.7 deviations before neighbours were asked.
TEST(TrackerBench, ErrorsOfCompressedVideoAreStated) {
  const TrackingScore s = score("h264", 12);
  if (s.rms_px < 0.04) GTEST_SKIP() << "this encoder does better: nothing to see";
  EXPECT_GT(s.jitter_px, 0.015);
  EXPECT_LT(s.normalised, 2.5);
}

// 0.10 px for 0.17 on the whole film; what is left is stated.
TEST(TrackerBench, OpenShuttersAreAllowedFor) {
  const TrackingScore without = score("head_5_open_1", 12, 0), with = score("head_5_open_1", 12);
  EXPECT_EQ(without.exposure, 0);
  EXPECT_NEAR(with.exposure, 1, 0.15);
  EXPECT_LT(with.rms_px, 0.75 * without.rms_px);
  EXPECT_LE(with.gross, without.gross);
  EXPECT_LT(with.normalised, 1.4);
  EXPECT_LT(score("head_5_open_1", 12, 1).rms_px, 0.75 * without.rms_px);
  // Nothing to allow for: not a bit changes.
  EXPECT_EQ(score("head_5").rms_px, score("head_5", 8, 0).rms_px);
}

TEST(TrackerBench, DiscsAreMaskedOrRefused) {
  const TrackingScore masked = score("disc_masked"), bare = score("disc_given_up"), again = score("disc");
  EXPECT_GT(masked.refusals[static_cast<std::size_t>(fitting::Refusal::occluded)], 0);
  EXPECT_EQ(masked.gross, 0);
  EXPECT_LT(bare.kept, 0.95);
  EXPECT_GT(again.kept, bare.kept);
}

}  // namespace
}  // namespace rhytid::tools
