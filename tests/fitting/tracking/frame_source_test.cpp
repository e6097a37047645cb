#include "fitting/tracking/frame_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "fitting/tracking/overlay.h"
#include "fitting/tracking/seeds.h"
#include "footage_folder.h"
#include "sim/core/error.h"
#include "speckle.h"

namespace rhytid::fitting {
namespace {

using ::testing::ElementsAre;
using testing::FootageFolder;
using ::testing::HasSubstr;

/// Mean grey of every frame delivered.
std::vector<double> means(FrameSourceOptions options) {
  FrameSource source(std::move(options));
  std::vector<double> out;
  while (auto frame = source.next()) out.push_back(std::round(cv::mean(frame->grey)[0]));
  return out;
}

FrameSourceOptions at(const std::string& path) {
  FrameSourceOptions o;
  o.path = path;
  return o;
}

std::string refusal(const FrameSourceOptions& o) {
  try {
    means(o);
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

cv::Mat flat(int grey) {
  return cv::Mat(20, 30, CV_8U, cv::Scalar(grey));
}

TEST(FrameSource, PatternsGlobsRangesAndSteps) {
  FootageFolder folder;
  for (int f = 0; f < 5; ++f) folder.add(flat(10 * f));
  FrameSourceOptions o = at(folder.file("f_%03d.png"));
  EXPECT_THAT(means(o), ElementsAre(0, 10, 20, 30, 40));
  o.first = 1;
  o.last = 3;
  o.step = 2;
  EXPECT_THAT(means(o), ElementsAre(10, 30));
  o.frames_per_second = 50;
  o.start_time_s = 2;
  FrameSource source(o);
  EXPECT_EQ(source.frames_asked(), 2);
  source.next();
  const auto frame = source.next();
  EXPECT_EQ(frame->index, 3);
  EXPECT_DOUBLE_EQ(frame->time_s, 2.06);
  EXPECT_FALSE(source.next().has_value());

  // Natural order: 9 before 10.
  FootageFolder more;
  cv::imwrite(more.file("x10.png"), flat(100));
  cv::imwrite(more.file("x9.png"), flat(90));
  cv::imwrite(more.file("y1.png"), flat(1));
  EXPECT_THAT(means(at(more.file("x*.png"))), ElementsAre(90, 100));
  EXPECT_THAT(means(at(more.file("?1.png"))), ElementsAre(1));
}

TEST(FrameSource, SixteenBitKeepsItsDigits) {
  FootageFolder folder;
  cv::imwrite(folder.file("deep.png"), cv::Mat(20, 30, CV_16U, cv::Scalar(12345)));
  FrameSource source(at(folder.file("deep.png")));
  EXPECT_NEAR(cv::mean(source.next()->grey)[0], 12345 * 255.0 / 65535, 1e-4);
  EXPECT_NEAR(source.quantum(), 1.0 / 257, 1e-12);
}

TEST(FrameSource, AGapInNumberedStillsIsNoEnd) {
  FootageFolder folder;
  for (const int number : {0, 1, 3, 12})
    cv::imwrite(folder.file("g_" + std::to_string(number) + ".png"), flat(number));
  EXPECT_THAT(refusal(at(folder.file("g_%d.png"))), HasSubstr("g_2.png before"));
  EXPECT_THAT(refusal(at(folder.file("g_%d.png"))), HasSubstr("g_3.png, expected a sequence without gaps"));
  FrameSourceOptions before = at(folder.file("g_%d.png"));
  before.last = 1;
  EXPECT_EQ(FrameSource(before).frames_asked(), 2) << "frames after the last that is wanted do not matter";
  // Files that the pattern does not name.
  std::filesystem::remove(folder.file("g_3.png"));
  std::filesystem::remove(folder.file("g_12.png"));
  cv::imwrite(folder.file("g_7.tif"), flat(7));
  cv::imwrite(folder.file("g_007.png"), flat(7));
  cv::imwrite(folder.file("g_mask.png"), flat(7));
  EXPECT_THAT(means(at(folder.file("g_%d.png"))), ElementsAre(0, 1));
}

TEST(FrameSource, NamesWhatIsWrong) {
  FootageFolder folder;
  folder.add(flat(1));
  EXPECT_THAT(refusal(at("nowhere.mp4")), HasSubstr("nowhere.mp4: got no such file"));
  EXPECT_THAT(refusal(at(folder.file("q_%03d.png"))), HasSubstr("q_000.png"));
  EXPECT_THAT(refusal(at(folder.file("f_%s.png"))), HasSubstr("one %d"));
  EXPECT_THAT(refusal(at(folder.file("*.tif"))), HasSubstr("no matching file"));
  std::ofstream(folder.file("text.mp4")) << "not a video";
  EXPECT_THAT(refusal(at(folder.file("text.mp4"))), HasSubstr("text.mp4"));
  std::ofstream(folder.file("broken.png")) << "not an image";
  EXPECT_THAT(refusal(at(folder.file("broken.png"))), HasSubstr("unreadable image"));
  cv::imwrite(folder.file("f_001.png"), cv::Mat(21, 30, CV_8U, cv::Scalar(1)));
  EXPECT_THAT(refusal(at(folder.file("f_%03d.png"))), HasSubstr("like the first image"));
  FrameSourceOptions o = at(folder.file("f_%03d.png"));
  o.first = 9;
  EXPECT_THAT(refusal(o), HasSubstr("less than the 2 frames"));
  o.first = -1;
  EXPECT_THAT(refusal(o), HasSubstr("first -1"));
}

TEST(Overlay, WritesAVideoThatReadsBack) {
  FootageFolder folder;
  const testing::Speckle skin(65, 49, 21);  // odd sides
  for (int f = 0; f < 6; ++f) folder.add(skin.render([](const Vec2& x) { return x; }, 1, f));
  TrackSet set;
  Track t;
  for (int f = 0; f < 6; ++f) {
    Observation o{f, f / 25.0, f == 3 ? TrackStatus::lost : TrackStatus::ok, {30.0 + f, 25}};
    o.covariance *= 0.01;
    t.observations.push_back(o);
  }
  set.tracks.push_back(t);
  FrameSource source = folder.source();
  OverlayOptions options;
  options.scale = 2;
  const OverlayReport report = write_overlay(source, set, "camera", folder.file("overlay.mp4"), options);
  std::printf("overlay codec %s\n", report.codec.c_str());
  EXPECT_EQ(report.frames, 6);
  for (const auto& entry : std::filesystem::directory_iterator(folder.file("")))
    EXPECT_EQ(entry.path().string().find(".tmp-"), std::string::npos) << entry.path();
  FrameSource back(at(report.path));
  EXPECT_EQ(back.size(), cv::Size(130, 98));
  EXPECT_EQ(back.frames_per_second(), 25);
  int frames = 0;
  bool coloured = false;
  while (auto frame = back.next()) {
    ++frames;
    cv::Mat channels[3];
    cv::split(frame->colour, channels);
    double difference = 0;
    cv::minMaxLoc(cv::abs(channels[0] - channels[2]), nullptr, &difference);
    coloured = coloured || difference > 60;  // the footage itself is grey
  }
  EXPECT_EQ(frames, 6);
  EXPECT_TRUE(coloured);
  FrameSource again = folder.source();
  EXPECT_THROW(write_overlay(again, set, "camera", "/no_such_folder/o.mp4"), InputError);
}

TEST(Seeds, CornersKeepTheirDistanceAndSpreadOut) {
  const testing::Speckle skin(200, 160, 22);
  cv::Mat grey;
  skin.render([](const Vec2& x) { return x; }, 0, 0).convertTo(grey, CV_32F);
  // The left third has much more contrast: it must not take all the points.
  cv::Mat left = grey(cv::Rect(0, 0, 66, 160));
  grey(cv::Rect(66, 0, 134, 160)).convertTo(grey(cv::Rect(66, 0, 134, 160)), CV_32F, 0.35, 80);
  SeedOptions o;
  o.max_tracks = 40;
  o.min_distance_px = 7;
  const std::vector<Vec2> seeds = choose_seeds(grey, {}, 13, o);
  EXPECT_EQ(seeds.size(), 40u);
  int on_right = 0;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    on_right += seeds[i].x() >= 66;
    EXPECT_GE(seeds[i].minCoeff(), 13);
    for (std::size_t j = 0; j < i; ++j) EXPECT_GE((seeds[i] - seeds[j]).norm(), 7);
  }
  EXPECT_GE(on_right, 20);
  cv::Mat forbidden = cv::Mat::zeros(grey.size(), CV_8U);
  forbidden(cv::Rect(0, 0, 100, 160)).setTo(255);
  for (const Vec2& p : choose_seeds(grey, forbidden, 13, o)) EXPECT_GE(p.x(), 100);
}

}  // namespace
}  // namespace rhytid::fitting
