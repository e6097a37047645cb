// Calibration on photographs made by others. Facts about the data are in the data folder's README.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "fitting/board_search.h"
#include "fitting/calibration_files.h"
#include "tests/support/real_data.h"

namespace rhytid::fitting {
namespace {

// Twelve photographs of 8 megapixels in which a hand holds a board of 14 by 19 corners. What is left is smooth
// over each board: boards bend, and the shutter rolls while the hand moves.
TEST(RealCalibration, Camera201) {
  RHYTID_REAL_FILE_OR_SKIP(path, "calibration/camera_201");
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(path)) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  const auto search = find_boards(files, std::nullopt, {});
  ASSERT_TRUE(search);
  EXPECT_EQ(to_string(search->board), "19 x 14");
  const auto c = calibrate(search->photographs, search->width, search->height, {});
  ASSERT_TRUE(c);
  std::printf("%s", calibration_text(*c).c_str());
  for (const std::string& sentence : c->warnings) std::printf("warning: %s\n", sentence.c_str());
  EXPECT_EQ(c->used, 12);
  EXPECT_LT(c->rms_px, 0.6);
  const LensParameter &fx = c->parameters[0], &fy = c->parameters[1], &cx = c->parameters[2];
  EXPECT_NEAR(fx.value, fy.value, 0.01 * fx.value) << "square pixels";
  EXPECT_NEAR(cx.value, 0.5 * search->width, 0.05 * search->width);
  EXPECT_LT(fx.high - fx.low, 0.05 * fx.value);
  EXPECT_GT(fx.jackknife_sigma, 2 * fx.linear_sigma) << "corners of a photograph err alike";
}

// Four of them determine the distortion too: without it they are predicted four times worse.
TEST(RealCalibration, FourPhotographsOfCamera201) {
  RHYTID_REAL_FILE_OR_SKIP(path, "calibration/camera_201");
  std::vector<std::string> files;
  for (const char* number : {"02", "04", "06", "08"})
    files.push_back((std::filesystem::path(path) / ("201_" + std::string(number) + ".jpg")).string());
  const auto search = find_boards(files, BoardSize{19, 14}, {});
  ASSERT_TRUE(search);
  const auto c = calibrate(search->photographs, search->width, search->height, {});
  ASSERT_TRUE(c);
  std::printf("%s", calibration_text(*c).c_str());
  EXPECT_EQ(c->model, "k1 k2");
  EXPECT_LT(c->rms_px, 0.6);
}

}  // namespace
}  // namespace rhytid::fitting
