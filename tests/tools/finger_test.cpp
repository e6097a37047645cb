// `rhytid finger` end to end: footage is rendered, the path is looked for from half a millimetre beside it.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "fitting/cameras.h"
#include "fitting/path_deviations.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/load.h"
#include "sim/scene/read_path.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"
#include "tests/tools/program_call.h"
#include "tools/verb.h"

namespace rhytid::tools {
std::unique_ptr<Verb> make_verb_render();
std::unique_ptr<Verb> make_verb_finger();

namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string bundled(const char* file) {
  return source_dir() + "/data/scenes/coarse_swipe/" + file;
}

std::string scene_text(const std::string& collider) {
  return R"({
  "name": "small",
  "skin": {
    "surface": {"grid": {"size": ["20 mm", "16 mm"], "cells": [4, 3]}},
    "layers": [{"name": "skin", "thickness": "1.5 mm", "order": 1, "youngs_modulus": "50 kPa"}]
  },
  "colliders": [{"name": "finger", "radius": "5 mm", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm",
                 "path": [{"time": 0, "position": [0, 0, 5.02]}], )" +
         collider + R"(}],
  "time": {"frame_rate": "20 Hz", "frames": 4}
})";
}

/// The bundled scene's path, moved.
std::string path_setting(const Scene& scene, const Vec3& shift) {
  nlohmann::json path = nlohmann::json::array();
  for (const PathKnot& knot : scene.colliders[0].path) {
    const Vec3 x = knot.position + shift;
    path.push_back({{"time", knot.time}, {"position", {x.x(), x.y(), x.z()}}});
  }
  return "/colliders/finger/path=" + path.dump();
}

Outcome call(const std::vector<std::string>& arguments) {
  return call_program(arguments, make_verb_render(), make_verb_finger());
}

class Finger : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_ / name; }

  /// The verb on rendered footage with the bundled scene and settings of it.
  Outcome found_with(const std::vector<std::string>& settings, double offset = 0) const {
    nlohmann::json other = {{"scene", bundled("scene.json")},
                            {"settings", settings},
                            {"camera", "out/camera.yaml"},
                            {"footage", "out/footage.avi"}};
    other["settings"].push_back("/time/offset=" + std::to_string(offset));
    write_file(path("other.json"), other.dump());
    return call({"finger", path("other.json"), "-o", path("found"), "--threads", "1"});
  }

 private:
  test::TemporaryFolder folder_;
};

// Seen at 50°, where the finger's body hides three fifths of the outline: from above it hides all.
TEST_F(Finger, IsFoundFromHalfAMillimetreBesideOrLost) {
  const Outcome rendered = call(
      {"render", bundled("case.json"), "-o", path("out"), "--set", "/render/tilt=50 deg", "--threads", "2"});
  ASSERT_EQ(rendered.code, 0) << rendered.err;
  const Scene truth = load_scene(bundled("scene.json"));
  const Vec3 shift(0.3, 0.3, -0.27);  // of length 0.5
  const Outcome outcome = found_with({path_setting(truth, shift)});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("in 7 of 7 frames")) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("\"path_file\": \"finger.csv\""));
  EXPECT_TRUE(fs::exists(path("found/finger.png")));

  const std::vector<PathKnot> knots = read_path(path("found/finger.csv"));
  ASSERT_EQ(knots.size(), 7u);
  const auto known = fitting::read_path_deviations(path("found/finger.csv"));
  ASSERT_TRUE(known) << "a fit reads them from there";
  ASSERT_EQ(known->own.size(), 7u);
  EXPECT_GT(known->own[0].trace(), 0);
  EXPECT_GT(known->shared.trace(), 0);
  const ColliderMotion motion(truth.colliders[0], 0);
  const fitting::Camera camera = fitting::read_camera(path("out/camera.yaml"));
  double across = 0, depth = 0;
  for (std::size_t f = 0; f < knots.size(); ++f) {
    EXPECT_NEAR(knots[f].time, static_cast<double>(f) / 24, 1e-12);
    const Vec3 centre = motion.at(knots[f].time).centre, error = knots[f].position - centre,
               sight = (centre - camera.centre()).normalized();
    depth = std::max(depth, std::fabs(error.dot(sight)));
    across = std::max(across, (error - error.dot(sight) * sight).norm());
  }
  std::printf("rendered footage: error at most %.4f mm across, %.4f mm in depth\n", across, depth);
  EXPECT_LT(across, 0.03);
  EXPECT_LT(depth, 0.2);

  const auto json = nlohmann::json::parse(read_file(path("found/finger.json")));
  EXPECT_NEAR(json["off_scene_rms_mm"], 0.5, 0.15);
  EXPECT_GT(json["frames"][0]["depth_sigma_mm"], json["frames"][0]["across_sigma_mm"]);

  // What is written is what a scene reads, on the clock of its paths: from there nothing is left to correct.
  fs::rename(path("found/finger.csv"), path("first.csv"));
  nlohmann::json text = nlohmann::json::parse(read_file(bundled("scene.json")), nullptr, true, true);
  text["colliders"][0].erase("path");
  text["colliders"][0]["path_file"] = "first.csv";
  write_file(path("scene.json"), text.dump());
  write_file(path("again.json"),
             R"({"scene": "scene.json", "camera": "out/camera.yaml", "footage": "out/footage.avi"})");
  const Outcome again = call({"finger", path("again.json"), "-o", path("found"), "--threads", "1"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_LT(nlohmann::json::parse(read_file(path("found/finger.json")))["off_scene_max_mm"], 0.02);

  ASSERT_EQ(found_with({}, 0.004).code, 0);  // 4 ms ahead: up to 0.09 mm
  EXPECT_NEAR(read_path(path("found/finger.csv"))[0].time, 0.004, 1e-12);

  const Outcome lost = found_with({path_setting(truth, Vec3(6, 3, 0))});
  EXPECT_EQ(lost.code, 3);
  EXPECT_THAT(lost.err, HasSubstr("frame 0 is lost: "));
  EXPECT_FALSE(fs::exists(path("found/finger.csv")));  // that of the run before is gone
  EXPECT_TRUE(nlohmann::json::parse(read_file(path("found/finger.json")))["frames"][0]["lost"]);
}

TEST_F(Finger, BadInputIsOneLine) {
  const auto error = [](const Outcome& outcome) {
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    return outcome.err;
  };
  const auto finger = [&](const std::string& collider, const std::vector<std::string>& more = {}) {
    write_file(path("scene.json"), scene_text(collider));
    write_file(path("case.json"), R"({"scene": "scene.json", "footage": "no.avi"})");
    std::vector<std::string> arguments = {"finger", path("case.json"), "-o", path("none")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return error(call(arguments));
  };
  const std::string sphere = R"("shape": "sphere")";
  EXPECT_THAT(finger(R"("shape": "capsule", "length": "4 mm")"),
              HasSubstr("/colliders/finger/shape: got 'capsule', expected a sphere"));
  EXPECT_THAT(finger(sphere, {"--collider", "thumb"}),
              HasSubstr("--collider: got 'thumb', expected one of finger"));
  EXPECT_THAT(finger(sphere, {"--window", "1"}), HasSubstr("--window"));
  EXPECT_THAT(finger(sphere), HasSubstr("/camera: got nothing"));
  fitting::write_camera(fitting::Camera{}, path("camera.yaml"));
  EXPECT_THAT(finger(sphere, {"--set", "/camera=camera.yaml"}),
              HasSubstr("no.avi: got no file, expected footage"));
  EXPECT_FALSE(fs::exists(path("none")));
}

}  // namespace
}  // namespace rhytid::tools
