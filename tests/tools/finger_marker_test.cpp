// `rhytid finger --marker` end to end: a finger with dots is rendered, and found from a millimetre beside it.
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "fitting/landmarks.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/load.h"
#include "sim/scene/read_path.h"
#include "tests/support/temporary_folder.h"
#include "tests/tools/program_call.h"
#include "tools/verb.h"

namespace rhytid::tools {
std::unique_ptr<Verb> make_verb_render();
std::unique_ptr<Verb> make_verb_finger();

namespace {

namespace fs = std::filesystem;
using fitting::Landmark;
using testing::HasSubstr;

constexpr int kFrames = 5;

/// A finger over skin that it hardly touches; moved by `shift`, turned by up to `turn` rad.
std::string scene_text(const Vec3& shift, double turn, const std::string& shape = R"("shape": "sphere")") {
  const auto knot = [&](double time, Vec3 x, double angle) {
    x += shift;
    return nlohmann::json{
        {"time", time}, {"position", {x[0], x[1], x[2]}}, {"rotation", {0.4 * angle, 0.9 * angle, 0}}};
  };
  return R"({
  "name": "small",
  "skin": {
    "surface": {"grid": {"size": ["20 mm", "16 mm"], "cells": [4, 3]}},
    "layers": [{"name": "skin", "thickness": "1.5 mm", "order": 1, "youngs_modulus": "50 kPa"}]
  },
  "colliders": [{"name": "finger", "radius": "5 mm", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm", )" +
         shape + R"(, "path": )" +
         nlohmann::json{knot(0, {-1, 0.5, 5.1}, 0), knot(0.25, {0.2, 0.8, 5.2}, turn)}.dump() + R"(}],
  "time": {"frame_rate": "20 Hz", "frames": 5}
})";
}

Outcome call(const std::vector<std::string>& arguments) {
  return call_program(arguments, make_verb_render(), make_verb_finger());
}

class FingerByMarker : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_ / name; }

  void render(double turn) const {
    write_file(path("truth.json"), scene_text(Vec3::Zero(), turn));
    write_file(
        path("truth_case.json"),
        R"({"scene": "truth.json", "render": {"width": 480, "height": 360, "finger_dots": 6, "noise": 1.5}})");
    const Outcome rendered = call({"render", path("truth_case.json"), "-o", path("out"), "--threads", "2"});
    ASSERT_EQ(rendered.code, 0) << rendered.err;
    // The scene that is corrected: held still in its turning, a millimetre off.
    write_file(path("scene.json"), scene_text(Vec3(0.6, -0.5, 0.6), 0));
    write_file(path("case.json"),
               R"({"scene": "scene.json", "camera": "out/camera.yaml", "footage": "out/footage.avi"})");
  }
  Outcome found(const std::string& marker, std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"finger", path("case.json"), "--marker",  marker,
                                          "-o",     path("found"),     "--threads", "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return call(arguments);
  }
  std::vector<Landmark> dots() const {
    return fitting::read_landmarks(path("out/marker_finger.csv"), 1, [](long) { return Vec3(Vec3::Zero()); });
  }
  /// A marker of some of the dots.
  std::string some(std::vector<std::size_t> which) const {
    std::string text = "name,x_px,y_px,x_mm,y_mm,z_mm,sigma_px\n";
    for (const std::size_t i : which) {
      const Landmark l = dots().at(i);
      text += l.name;
      for (const double v : {l.pixel.x(), l.pixel.y(), l.point.x(), l.point.y(), l.point.z(), 0.05})
        text += "," + exact_text(v);
      text += "\n";
    }
    write_file(path("some.csv"), text);
    return path("some.csv");
  }
  struct Error {
    double centre = 0, turn = 0;  ///< mm, rad; the largest
    double normalised = 0;        ///< mean of (e/σ)² of the centre's coordinates
  };
  Error error_of() const {
    const std::vector<PathKnot> knots = read_path(path("found/finger.csv"));
    EXPECT_EQ(knots.size(), kFrames + 1u);
    const Scene truth = load_scene(path("truth.json"));
    const ColliderMotion motion(truth.colliders[0], 0);
    const auto json = nlohmann::json::parse(read_file(path("found/finger.json")));
    Error error;
    for (std::size_t f = 0; f < knots.size(); ++f) {
      const BodyPose exact = motion.at(knots[f].time);
      const Vec3 off = knots[f].position - exact.centre;
      error.centre = std::max(error.centre, off.norm());
      const double angle = knots[f].rotation.norm();
      const Mat3 turned = angle > 0 ? Eigen::AngleAxisd(angle, knots[f].rotation / angle).toRotationMatrix()
                                    : Mat3::Identity();
      error.turn = std::max(error.turn, Eigen::AngleAxisd(Mat3(turned * exact.rotation.transpose())).angle());
      for (int k = 0; k < 3; ++k)
        error.normalised +=
            std::pow(off[k] / json["frames"][f]["sigma_mm"][static_cast<std::size_t>(k)].get<double>(), 2) /
            (3.0 * static_cast<double>(knots.size()));
    }
    return error;
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(FingerByMarker, DotsTellWhereAFingerIsAndHowItTurns) {
  render(0.12);
  ASSERT_EQ(dots().size(), 6u);
  const Outcome six = found(path("out/marker_finger.csv"));
  ASSERT_EQ(six.code, 0) << six.err;
  EXPECT_THAT(six.out, HasSubstr("in 6 of 6 frames")) << six.err;
  EXPECT_THAT(six.out, HasSubstr("its turning was found too"));
  EXPECT_TRUE(fs::exists(path("found/finger.png")));
  EXPECT_TRUE(fs::exists(path("found/finger_tracks.csv")));
  const Error error = error_of();
  std::printf("six dots, turning: centre to %.3f mm, turning to %.2f degrees, normalised %.2f\n",
              error.centre, 57.3 * error.turn, error.normalised);
  EXPECT_LT(error.centre, 0.15);
  EXPECT_LT(error.turn, 0.02);
  EXPECT_LT(error.normalised, 4);
  const auto json = nlohmann::json::parse(read_file(path("found/finger.json")));
  EXPECT_EQ(json["rotation"], "found");
  EXPECT_NEAR(json["off_scene_rms_mm"], 1, 0.15);
  EXPECT_LE(json["frames"][3]["own_sigma_mm"][0].get<double>(),
            json["frames"][3]["sigma_mm"][0].get<double>());

  // The scene's path does not turn: six dots do not agree with that.
  const Outcome held = found(path("out/marker_finger.csv"), {"--hold-rotation"});
  EXPECT_EQ(held.code, 3);
  EXPECT_THAT(held.err, HasSubstr("the points do not move like a body that turns as the scene's path says"));
}

TEST_F(FingerByMarker, FewDotsTellWhereItIs) {
  render(0);
  const Outcome two = found(some({1, 3}));
  ASSERT_EQ(two.code, 0) << two.err;
  const Error error = error_of();
  std::printf("two dots: centre to %.3f mm, normalised %.2f\n", error.centre, error.normalised);
  EXPECT_LT(error.centre, 0.15);
  EXPECT_EQ(error.turn, 0);

  const Outcome one = found(some({0}));
  EXPECT_EQ(one.code, 2);
  EXPECT_THAT(one.err,
              HasSubstr("some.csv: got 1 of 1 marker point that can be tracked, expected 2 or more"));
  const Outcome with_depth = found(some({0}), {"--depth-of-scene"});
  ASSERT_EQ(with_depth.code, 0) << with_depth.err;
  EXPECT_TRUE(
      nlohmann::json::parse(read_file(path("found/finger.json")))["frames"][0]["depth_sigma_mm"].is_null());
  EXPECT_LT(error_of().centre, 0.9);  // the scene is 0.6 mm off in depth and more across

  // A shape without an outline of its own.
  write_file(path("scene.json"), scene_text(Vec3(0.6, -0.5, 0.6), 0,
                                            R"("shape": "capsule", "length": "4 mm", "axis": [0, 1, 0])"));
  EXPECT_EQ(found(path("out/marker_finger.csv"), {"--hold-rotation"}).code, 0);
  EXPECT_LT(error_of().centre, 0.15);
}

TEST_F(FingerByMarker, BadInputIsOneLine) {
  render(0);
  const auto error = [&](const std::string& file, const std::vector<std::string>& more = {}) {
    const Outcome outcome = found(file, more);
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_FALSE(fs::exists(path("found")));
    return outcome.err;
  };
  EXPECT_THAT(error(path("no.csv")), HasSubstr("no.csv: got no readable file"));
  EXPECT_THAT(error(path("out")), HasSubstr("got a folder"));
  EXPECT_THAT(error(path("out/marker_finger.csv"), {"--window", "20"}), HasSubstr("--window"));
  EXPECT_THAT(error(path("out/marker_finger.csv"), {"--sigma", "0"}), HasSubstr("--sigma"));
  write_file(path("far.csv"), "name,x_px,y_px,x_mm,y_mm,z_mm\na,100,100,0,0,5\n\nb,5000,100,1,0,5\n");
  EXPECT_THAT(error(path("far.csv")),
              HasSubstr("far.csv:4: got 'b' at 5000, 100, expected a pixel from 13, 13"));
}

}  // namespace
}  // namespace rhytid::tools
