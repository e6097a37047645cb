#include "fitting/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "fitting/board_search.h"
#include "fitting/calibration_files.h"
#include "fitting/utf8.h"
#include "sim/core/error.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr BoardSize kBoard{9, 6};
constexpr double kSquare = 25;  // mm

Camera truth(const std::array<double, 5>& distortion) {
  Camera c;
  c.intrinsics << 700, 0, 325, 0, 705, 236, 0, 0, 1;
  c.distortion = distortion;
  c.width = 640, c.height = 480;
  return c;
}

/// The truth as seen from board i of n: tilted by `tilt` rad to changing sides, in changing parts of the
/// picture.
Camera at_board(Camera camera, int i, int n, double tilt) {
  const double turn = 2 * M_PI * i / n * 3 + 0.3;
  const Vec3 axis(std::cos(turn), std::sin(turn), 0);
  camera.rotation =
      (Eigen::AngleAxisd(tilt, axis) * Eigen::AngleAxisd(0.15 * (i % 3 - 1), Vec3::UnitZ())).matrix();
  const double depth = 480 + 40 * (i % 4);
  const Vec3 middle(0.5 * (kBoard.columns - 1) * kSquare, 0.5 * (kBoard.rows - 1) * kSquare, 0);
  const Vec3 seen_at((i % 3 - 1) * 0.11 * depth, (i % 4 - 1.5) * 0.06 * depth, depth);
  camera.translation = seen_at - camera.rotation * middle;
  return camera;
}

std::vector<Vec2> exact_corners(const Camera& camera) {
  std::vector<Vec2> corners;
  for (int row = 0; row < kBoard.rows; ++row)
    for (int column = 0; column < kBoard.columns; ++column)
      corners.push_back(camera.project(Vec3(column * kSquare, row * kSquare, 0)));
  return corners;
}

/// Photographs without pictures: exact corners with noise.
std::vector<CalibrationPhotograph> corners_with_noise(const Camera& camera, int n, double tilt, double sigma,
                                                      unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma);
  std::vector<CalibrationPhotograph> list(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    CalibrationPhotograph& p = list[static_cast<std::size_t>(i)];
    p.file = "photograph " + std::to_string(i);
    p.board = {kBoard, exact_corners(at_board(camera, i, n, tilt))};
    for (Vec2& corner : p.board.corners) corner += Vec2(noise(random), noise(random));
  }
  return list;
}

/// Photographs of the board by ray casting, 4 x 4 samples a pixel, with a little blur and
/// noise.
class Studio {
 public:
  explicit Studio(const Camera& camera) : camera_(camera) {
    for (int y = 0; y < kSamples * camera.height; ++y)
      for (int x = 0; x < kSamples * camera.width; ++x)
        rays_.push_back(camera.undistorted(Vec2((x + 0.5) / kSamples - 0.5, (y + 0.5) / kSamples - 0.5)));
  }
  cv::Mat picture(const Camera& pose, unsigned seed) const {
    const Vec3 origin = pose.centre();
    cv::Mat sum(camera_.height, camera_.width, CV_64F, cv::Scalar(0));
    std::size_t k = 0;
    for (int y = 0; y < kSamples * camera_.height; ++y)
      for (int x = 0; x < kSamples * camera_.width; ++x) {
        const Vec2& ray = rays_[k++];
        const Vec3 d = pose.rotation.transpose() * Vec3(ray.x(), ray.y(), 1);
        const Vec3 p = origin - origin.z() / d.z() * d;
        const double u = p.x() / kSquare + 1, v = p.y() / kSquare + 1;  // squares; the first corner at (1, 1)
        const bool is_board = u > 0 && v > 0 && u < kBoard.columns + 1 && v < kBoard.rows + 1;
        const bool is_sheet = u > -1 && v > -1 && u < kBoard.columns + 2 && v < kBoard.rows + 2;
        const bool is_black = is_board && (static_cast<int>(u) + static_cast<int>(v)) % 2 == 0;
        sum.at<double>(y / kSamples, x / kSamples) += is_black ? 30 : is_sheet ? 220 : 110;
      }
    cv::Mat noise(sum.size(), CV_64F), out;
    cv::GaussianBlur(sum, sum, cv::Size(), 0.7);
    cv::RNG random(seed);
    random.fill(noise, cv::RNG::NORMAL, 0, 2);
    cv::Mat(sum / (kSamples * kSamples) + noise).convertTo(out, CV_8U);
    return out;
  }

 private:
  static constexpr int kSamples = 4;
  Camera camera_;
  std::vector<Vec2> rays_;
};

std::array<double, kNumLensParameters> values_of(const Camera& c) {
  const auto& d = c.distortion;
  return {c.intrinsics(0, 0),
          c.intrinsics(1, 1),
          c.intrinsics(0, 2),
          c.intrinsics(1, 2),
          d[0],
          d[1],
          d[2],
          d[3],
          d[4]};
}

class CalibrationFiles : public ::testing::Test {
 protected:
  const test::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
};

template <class Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

// From pictures to numbers: the size of the board is found, corners are right to some hundredths of a pixel, the
// camera comes back within its intervals.
TEST_F(CalibrationFiles, RecoversTheCameraThatTookThePictures) {
  const Camera camera = truth({-0.25, 0.1, 1e-3, -5e-4, 0});
  const Studio studio(camera);
  constexpr int n = 12;
  std::vector<std::string> files;
  for (int i = 0; i < n; ++i) {
    files.push_back(file("board_" + std::to_string(i) + ".png"));
    cv::imwrite(files.back(), studio.picture(at_board(camera, i, n, 0.5), static_cast<unsigned>(i)));
  }
  files.push_back(file("empty.png"));
  cv::imwrite(files.back(), cv::Mat(camera.height, camera.width, CV_8U, cv::Scalar(90)));
  const auto search = find_boards(files, std::nullopt, {});
  ASSERT_TRUE(search);
  EXPECT_EQ(search->board, kBoard);
  double squares = 0;
  int corners = 0;
  for (int i = 0; i < n; ++i) {
    const std::vector<Vec2>& found = search->photographs[static_cast<std::size_t>(i)].board.corners;
    ASSERT_EQ(found.size(), 54u) << i;
    for (const Vec2& exact : exact_corners(at_board(camera, i, n, 0.5))) {
      double nearest = 1e30;  // whichever corner comes first
      for (const Vec2& corner : found) nearest = std::min(nearest, (corner - exact).squaredNorm());
      squares += nearest, ++corners;
    }
  }
  std::printf("corners: rms %.4f px\n", std::sqrt(squares / corners));
  EXPECT_LT(std::sqrt(squares / corners), 0.07);
  EXPECT_THAT(search->photographs.back().reason, HasSubstr("no board of 9 x 6"));

  CalibrationOptions options;
  options.square = kSquare;
  const auto c = calibrate(search->photographs, search->width, search->height, options);
  ASSERT_TRUE(c);
  std::printf("%s", calibration_text(*c).c_str());
  EXPECT_EQ(c->used, n);
  EXPECT_LT(c->rms_px, 0.08);
  const auto exact = values_of(camera);
  int inside = 0, fitted = 0;
  for (std::size_t k = 0; k < exact.size(); ++k) {
    const LensParameter& p = c->parameters[k];
    if (!p.is_fitted) continue;
    ++fitted;
    inside += p.low <= exact[k] && exact[k] <= p.high;
    std::printf("%s: %.6g in %.6g .. %.6g, truth %.6g\n", kLensParameters[k], p.value, p.low, p.high,
                exact[k]);
  }
  EXPECT_GE(fitted, 6);
  EXPECT_GE(inside, fitted - 1);
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_NEAR(c->parameters[k].value, exact[k], 1.5) << kLensParameters[k];
  EXPECT_NEAR(c->parameters[4].value, -0.25, 0.02);
  for (int i = 0; i < n; ++i) EXPECT_NEAR(c->photographs[static_cast<std::size_t>(i)].tilt, 0.5, 0.15);

  const auto json = nlohmann::json::parse(calibration_json(*c));
  EXPECT_EQ(json["parameters"]["fx"]["value"].get<double>(), c->parameters[0].value);
  EXPECT_EQ(json["photographs"][n]["used"], false);
  const std::string svg = calibration_svg(*c);
  EXPECT_THAT(svg, AllOf(HasSubstr("<svg"), HasSubstr("board_3.png"), HasSubstr("empty.png, left out"),
                         HasSubstr("</svg>")));

  // Where the board of a photograph is: its camera's place, up to which of the corners is the first.
  Camera placed = c->camera;
  EXPECT_LT(place_at_board(search->photographs[2].board, kSquare, &placed), 0.08);
  EXPECT_NEAR(placed.centre().norm(), at_board(camera, 2, n, 0.5).centre().norm(), 60);
  EXPECT_LT(placed.centre().z(), 0) << "z points away from the camera";
}

// Of parameters whose corners have nothing but independent noise, about 95 % must lie in their intervals.
TEST(Calibration, IntervalsHoldTheTruthAndOnlyDeterminedTermsAreFitted) {
  int inside = 0, all = 0, expected_models = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Camera camera = truth(seed % 2 ? std::array<double, 5>{-0.2, 0, 0, 0, 0} : std::array<double, 5>{});
    const auto c = calibrate(corners_with_noise(camera, 10, 0.5, 0.1, seed), 640, 480, {});
    ASSERT_TRUE(c);
    expected_models += c->model == (seed % 2 ? "k1" : "none");
    EXPECT_NEAR(c->rms_px, 0.1 * std::sqrt(2.0), 0.015);
    const auto exact = values_of(camera);
    for (std::size_t k = 0; k < exact.size(); ++k) {
      const LensParameter& p = c->parameters[k];
      if (!p.is_fitted) {
        EXPECT_EQ(p.value, 0);
        continue;
      }
      EXPECT_GT(p.linear_sigma, 0);
      inside += p.low <= exact[k] && exact[k] <= p.high, ++all;
      EXPECT_NEAR(p.value, exact[k], 2 * (p.high - p.low));
    }
  }
  std::printf("%d of %d intervals hold the truth\n", inside, all);
  EXPECT_GE(inside, all - 2);
  EXPECT_GE(expected_models, 3) << "a fourth may be the one in twenty";
}

// With few photographs too: the errors without distortion differ by factors between them, all are large.
TEST(Calibration, DistortionIsNotLeftOutBecausePhotographsAreFew) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const auto c =
        calibrate(corners_with_noise(truth({0.19, -0.36, 0, 0, 0}), 4, 0.3, 0.1, seed), 640, 480, {});
    ASSERT_TRUE(c);
    double best = 1e30, chosen = 0;
    for (const LensModel& m : c->models) {
      best = std::min(best, m.predicted_rms);
      if (m.is_chosen) chosen = m.predicted_rms;
      std::printf("%s: %.3f px%s\n", m.name.c_str(), m.predicted_rms, m.is_chosen ? " chosen" : "");
    }
    EXPECT_NE(c->model, "none");
    EXPECT_LT(chosen, std::sqrt(1.2) * best + 1e-12) << "no better with more must be true";
    EXPECT_THAT(calibration_text(*c), ::testing::ContainsRegex("no better with more|no more than chance"));
  }
}

// The deviation of the linearised fit is that of many draws of the noise, no smaller and no larger.
TEST(Calibration, LinearisedDeviationsAreThoseOfManyDraws) {
  constexpr int kDraws = 40;
  const Camera camera = truth({-0.2, 0, 0, 0, 0});
  const auto exact = values_of(camera);
  std::array<double, 5> squares{}, stated{};
  int draws = 0;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    const auto c = calibrate(corners_with_noise(camera, 5, 0.5, 0.1, 100 + seed), 640, 480, {});
    ASSERT_TRUE(c);
    if (c->model != "k1") continue;
    ++draws;
    for (std::size_t k = 0; k < squares.size(); ++k) {
      squares[k] += std::pow(c->parameters[k].value - exact[k], 2);
      stated[k] += std::pow(c->parameters[k].linear_sigma, 2);
    }
  }
  EXPECT_GE(draws, 0.7 * kDraws);
  double log_ratio = 0;
  for (std::size_t k = 0; k < squares.size(); ++k) {
    const double ratio = std::sqrt(stated[k] / squares[k]);
    log_ratio += std::log(ratio) / static_cast<double>(squares.size());
    std::printf("%s: stated %.3f of the spread of %d draws\n", kLensParameters[k], ratio, draws);
    EXPECT_NEAR(ratio, 1, 0.3) << kLensParameters[k];
  }
  EXPECT_NEAR(std::exp(log_ratio), 1, 0.15);
}

// A second copy of every photograph tells nothing new, whatever its corners err alike.
TEST(Calibration, CopiesOfPhotographsDoNotNarrowTheIntervals) {
  std::mt19937 random(3);
  std::normal_distribution<double> bend(0, 0.4);  // px, of a board that is not flat
  std::vector<CalibrationPhotograph> once = corners_with_noise(truth({-0.2, 0, 0, 0, 0}), 8, 0.5, 0.02, 9);
  for (CalibrationPhotograph& p : once) {
    const Vec2 by(bend(random), bend(random));
    for (std::size_t i = 0; i < p.board.corners.size(); ++i)
      p.board.corners[i] += std::pow(static_cast<double>(i % kBoard.columns) / 4 - 1, 2) * by;
  }
  std::vector<CalibrationPhotograph> twice;
  for (const CalibrationPhotograph& p : once) twice.insert(twice.end(), 2, p);
  const auto one = calibrate(once, 640, 480, {}), two = calibrate(twice, 640, 480, {});
  ASSERT_TRUE(one && two);
  ASSERT_EQ(one->model, two->model);
  ASSERT_EQ(two->used, 16);
  for (std::size_t k = 0; k < 4; ++k) {
    const LensParameter &a = one->parameters[k], &b = two->parameters[k];
    std::printf("%s: %.3f, with copies %.3f\n", kLensParameters[k], a.high - a.low, b.high - b.low);
    EXPECT_GT(b.high - b.low, 0.98 * (a.high - a.low)) << kLensParameters[k];
  }
}

TEST(Calibration, PhotographsAtOddsWithTheOthersAreNamed) {
  auto photographs = corners_with_noise(truth({-0.2, 0, 0, 0, 0}), 9, 0.5, 0.05, 5);
  for (std::size_t i = 0; i < 9; ++i) photographs[4].board.corners[i] += Vec2(6, -4);  // a bent first row
  const auto c = calibrate(photographs, 640, 480, {});
  ASSERT_TRUE(c);
  EXPECT_EQ(c->used, 8);
  EXPECT_FALSE(c->photographs[4].is_used);
  EXPECT_THAT(c->photographs[4].reason, HasSubstr("its corners are off by"));
  EXPECT_LT(c->rms_px, 0.08);
}

TEST(Calibration, SaysWhatIsPoor) {
  const auto flat = calibrate(corners_with_noise(truth({}), 4, 0.02, 0.1, 3), 640, 480, {});
  ASSERT_TRUE(flat);
  const std::string all = ::testing::PrintToString(flat->warnings);
  EXPECT_THAT(all, AllOf(HasSubstr("only 4 photographs"), HasSubstr("hardly tilted")));
  auto small = corners_with_noise(truth({}), 10, 0.5, 0.1, 3);
  const auto good = calibrate(small, 640, 480, {});
  ASSERT_TRUE(good);
  EXPECT_THAT(::testing::PrintToString(good->warnings), ::testing::Not(HasSubstr("tilted")));
  // The same corners in the middle of a picture of twice the size leave its border empty.
  for (CalibrationPhotograph& p : small)
    for (Vec2& corner : p.board.corners) corner += Vec2(320, 240);
  const auto bare = calibrate(small, 1280, 960, {});
  ASSERT_TRUE(bare);
  EXPECT_THAT(::testing::PrintToString(bare->warnings),
              AllOf(HasSubstr("extrapolated"), HasSubstr("corners cover")));
  EXPECT_LT(bare->reach, 0.8);
}

// Names of files need not be UTF-8, and those that are may not be cut within a character.
TEST(Calibration, AnyNameOfAFileGivesValidTexts) {
  auto photographs = corners_with_noise(truth({}), 3, 0.5, 0.1, 1);
  photographs[0].file = "fl\xfcgel.jpg";
  photographs[1].file = "x";
  for (int i = 0; i < 12; ++i) photographs[1].file += "\xc3\xa4";  // the last 21 of 25 bytes begin within one
  const auto c = calibrate(photographs, 640, 480, {});
  ASSERT_TRUE(c);
  const auto json = nlohmann::json::parse(calibration_json(*c));
  EXPECT_EQ(json["photographs"][0]["file"], "fl\xef\xbf\xbdgel.jpg");
  EXPECT_EQ(json["photographs"][1]["file"], photographs[1].file);
  const std::string svg = calibration_svg(*c);
  EXPECT_TRUE(is_utf8(svg));
  EXPECT_THAT(svg, AllOf(HasSubstr("fl\xef\xbf\xbdgel.jpg"), HasSubstr("...\xc3\xa4")));
}

TEST(Calibration, StopsWhenTold) {
  CalibrationOptions options;
  options.progress = [](int done, int) { return done < 2; };
  EXPECT_FALSE(calibrate(corners_with_noise(truth({}), 5, 0.5, 0.1, 1), 640, 480, options));
}

TEST_F(CalibrationFiles, RefusesWhatCannotBeUsed) {
  const Camera camera = truth({});
  const Studio studio(camera);
  std::vector<std::string> files;
  for (int i = 0; i < 3; ++i) {
    files.push_back(file(std::to_string(i) + ".png"));
    cv::imwrite(files.back(), studio.picture(at_board(camera, i, 3, 0.4), 1));
  }
  std::ofstream(file("text.png")) << "no picture";
  EXPECT_THAT(refusal([&] { read_photograph("missing.png"); }), HasSubstr("missing.png: got no such file"));
  EXPECT_THAT(refusal([&] { read_photograph(file("text.png")); }), HasSubstr("no picture"));
  EXPECT_THAT(refusal([&] { read_photograph(folder_.string()); }), HasSubstr("a folder"));
  EXPECT_THAT(refusal([&] { find_boards({files[0], files[0]}, kBoard, {}); }), HasSubstr("twice"));
  EXPECT_THAT(refusal([&] {
                find_boards({files[0], (folder_ / "." / "0.png").string()}, kBoard, {});
              }),
              HasSubstr("twice"));
  EXPECT_THAT(
      refusal([&] {
        find_boards({files[0]}, BoardSize{10, 7}, {});
      }),
      AllOf(HasSubstr("no board of 10 x 7 inner corners in 1 photograph"), HasSubstr("shows one of 9 x 6")));
  EXPECT_THAT(refusal([&] { parse_board_size("9by6", "--board"); }), HasSubstr("--board: got '9by6'"));
  EXPECT_THAT(refusal([&] { parse_board_size("2x6", "--board"); }), HasSubstr("from 3 to 100"));
  const auto one = find_boards({files[0]}, kBoard, {});
  EXPECT_THAT(refusal([&] { calibrate(one->photographs, 640, 480, {}); }),
              AllOf(HasSubstr("1 photograph with a board"), HasSubstr("at least 3")));
  cv::imwrite(file("large.png"), cv::Mat(600, 800, CV_8U, cv::Scalar(90)));
  const auto mixed = find_boards({files[0], files[1], file("large.png")}, kBoard, {});
  EXPECT_THAT(mixed->photographs[2].reason, HasSubstr("800 x 600 px, the others 640 x 480"));
  // Pictures of something else have no say in the size, however many they are.
  for (const char* name : {"large2.png", "large3.png"})
    std::filesystem::copy_file(file("large.png"), file(name));
  const auto few = find_boards(
      {file("large.png"), files[0], file("large2.png"), files[1], file("large3.png")}, kBoard, {});
  EXPECT_EQ(few->width, 640);
  EXPECT_EQ(few->photographs[1].board.corners.size(), 54u);
  EXPECT_THAT(few->photographs[0].reason, HasSubstr("800 x 600 px, the others 640 x 480"));
}

}  // namespace
}  // namespace rhytid::fitting
