// Frames from the last to the first, and points that are followed there and back: a known drift is seen, and
// none where there is none.
#include "fitting/tracking/there_and_back.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdio>
#include <opencv2/videoio.hpp>

#include "footage_folder.h"
#include "sim/core/error.h"
#include "speckle.h"

namespace rhytid::fitting {
namespace {

using testing::FootageFolder;
using ::testing::HasSubstr;
using testing::Speckle;

std::vector<Frame> all_of(const FrameSourceOptions& options) {
  FrameSource source(options);
  std::vector<Frame> frames;
  while (std::optional<Frame> frame = source.next()) frames.push_back(std::move(*frame));
  return frames;
}

void expect_reversed(FrameSourceOptions options) {
  std::vector<Frame> forwards = all_of(options);
  ASSERT_FALSE(forwards.empty());
  options.backwards = true;
  EXPECT_EQ(FrameSource(options).frames_asked(), static_cast<int>(forwards.size()));
  std::vector<Frame> backwards = all_of(options);
  std::reverse(backwards.begin(), backwards.end());
  ASSERT_EQ(backwards.size(), forwards.size());
  for (std::size_t i = 0; i < forwards.size(); ++i) {
    EXPECT_EQ(backwards[i].index, forwards[i].index);
    EXPECT_EQ(backwards[i].time_s, forwards[i].time_s);
    EXPECT_EQ(cv::norm(backwards[i].grey, forwards[i].grey, cv::NORM_INF), 0) << "frame " << i;
    EXPECT_EQ(cv::norm(backwards[i].colour, forwards[i].colour, cv::NORM_INF), 0) << "frame " << i;
  }
}

/// Frames so large that a video of them takes several blocks.
TEST(FramesBackwards, AreTheSameFrames) {
  FootageFolder folder;
  const std::string video = folder.file("large.avi");
  {
    cv::VideoWriter writer(video, cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25,
                           {1920, 1080});
    for (int f = 0; f < 21; ++f)
      writer.write(cv::Mat(1080, 1920, CV_8UC3, cv::Scalar(5 * f, 200 - 7 * f, 90)));
  }
  FrameSourceOptions options;
  options.path = video;
  expect_reversed(options);
  options.first = 2, options.last = 19, options.step = 3;
  expect_reversed(options);
  options.last = 400;  // more than there are
  options.backwards = true;
  const std::vector<Frame> frames = all_of(options);
  ASSERT_EQ(frames.size(), 7u);
  EXPECT_EQ(frames.front().index, 20);
  EXPECT_EQ(frames.back().index, 2);
}

TEST(FramesBackwards, Stills) {
  FootageFolder folder;
  const Speckle skin(64, 48, 3);
  for (int f = 0; f < 5; ++f) folder.add(skin.render([](const Vec2& x) { return x; }, 2, f));
  FrameSourceOptions options;
  options.path = folder.file("f_%03d.png");
  options.frames_per_second = 25;
  expect_reversed(options);
  options.first = 1, options.step = 2;
  expect_reversed(options);
}

struct Moved {
  FootageFolder folder;
  FrameSourceOptions footage;
  TrackerOptions options;

  /// Speckle that moves by 0.7 px a frame; `noise` in grey levels.
  Moved(int frames, double noise) {
    const Speckle skin(220, 180, 21);
    for (int f = 0; f < frames; ++f)
      folder.add(skin.render([&](const Vec2& x) { return Vec2(x.x() - 0.7 * f, x.y()); }, noise,
                             static_cast<unsigned>(f + 1)));
    footage.path = folder.file("f_%03d.png");
    footage.frames_per_second = 25;
    options.seeds.max_tracks = 60;
    options.seeds.region = {50, 50, 120, 80};
  }
  TrackSet forward() {
    FrameSource source(footage);
    return track(source, options).tracks;
  }
};

/// Both ways compare the same two pictures, so that their noise cancels.
TEST(ThereAndBack, IsBlindToTheNoiseOfThePictures) {
  Moved clip(12, 2.5);
  const TrackSet forward = clip.forward();
  const std::optional<ThereAndBack> back = there_and_back(clip.footage, forward, clip.options);
  ASSERT_TRUE(back);
  std::printf("%s\n", summary(*back).c_str());
  EXPECT_EQ(back->sent, static_cast<int>(forward.tracks.size()));
  EXPECT_EQ(back->returned, back->sent);
  EXPECT_GT(back->median_px, 1e-4);  // 0 would be a comparison of a track with itself
  EXPECT_LT(back->median_px, 0.01);  // the points themselves are off by 0.02 px
  EXPECT_GE(back->p90_px, back->median_px);
}

TEST(ThereAndBack, ADriftOfTheWayThereIsMeasured) {
  Moved clip(12, 2.5);
  TrackSet drifted = clip.forward();
  // As if the way there had slipped by 0.8 px: back from there nothing slips.
  const Vec2 slip(0.48, -0.64);
  for (Track& t : drifted.tracks) t.observations.back().pixel += slip;
  const std::optional<ThereAndBack> back = there_and_back(clip.footage, drifted, clip.options);
  ASSERT_TRUE(back);
  std::printf("slip 0.8 px: %s\n", summary(*back).c_str());
  EXPECT_NEAR(back->median_px, 0.8, 0.05);
}

TEST(ThereAndBack, LostPointsAreNotSentAndAStopIsNoAnswer) {
  Moved clip(6, 1);
  TrackSet forward = clip.forward();
  const int all = static_cast<int>(forward.tracks.size());
  ASSERT_GT(all, 10);
  for (int i = 0; i < 5; ++i)
    forward.tracks[static_cast<std::size_t>(2 * i)].observations.back().status = TrackStatus::lost;
  std::optional<ThereAndBack> back = there_and_back(clip.footage, forward, clip.options);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->sent, all - 5);
  EXPECT_EQ(back->returned, all - 5);
  EXPECT_LT(back->median_px, 0.1);  // every point is compared with its own start

  clip.options.progress = [](const FrameCounts&, int processed, int) { return processed < 3; };
  EXPECT_FALSE(there_and_back(clip.footage, forward, clip.options));
  for (Track& t : forward.tracks) t.observations.back().status = TrackStatus::lost;
  back = there_and_back(clip.footage, forward, clip.options);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->sent + back->returned, 0);
}

}  // namespace
}  // namespace rhytid::fitting
