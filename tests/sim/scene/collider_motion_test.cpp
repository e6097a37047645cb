// Colliders from scene files: shapes, orientation, interpolation, paths from CSV files, and what is refused.
#include "sim/scene/collider_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>
#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

using testing::HasSubstr;

Scene scene_with(const std::vector<std::string>& settings) {
  return parse_scene_text(test::drag_scene(1, 2), "test.json", settings);
}
std::string refusal(const std::vector<std::string>& settings) {
  try {
    (void)scene_with(settings);
  } catch (const InputError& error) {
    return error.what();
  }
  return "not refused";
}

const std::string kTurning =
    R"(/colliders/finger/path=[{"time": 0, "position": [0, 0, 6]},
    {"time": 1, "position": [2, 0, 6], "rotation": ["90 deg", 0, 0]}])";

TEST(ColliderMotion, TurnsAtConstantSpeedBetweenKnots) {
  const Scene scene = scene_with({kTurning});
  const ColliderMotion motion(scene.colliders[0], 0);
  for (const double t : {0.0, 0.25, 0.7, 1.0}) {
    const BodyPose pose = motion.at(t);
    const Mat3 expected = Eigen::AngleAxisd(t * std::numbers::pi / 2, Vec3::UnitX()).toRotationMatrix();
    EXPECT_LT((pose.rotation - expected).norm(), 1e-14);
    EXPECT_NEAR(pose.centre[0], 2 * t, 1e-15);
  }
  EXPECT_EQ(ColliderMotion(scene_with({}).colliders[0], 0).orientations(), nullptr);
}

TEST(ColliderMotion, TermsSeeTheSamePoses) {
  for (const char* kind : {"linear", "spline", "clamped_spline"}) {
    const SceneModel m(scene_with({kTurning, std::string("/colliders/finger/interpolation=") + kind}));
    const ColliderMotion motion(m.scene().colliders[0], 0);
    for (const Term& term : m.model().terms) {
      if (term.name() != "contact finger") continue;
      const double t = 0.37;
      const auto theta = term.load_theta({0, 0.2, t}, m.native())[0];
      const BodyPose pose = motion.at(t);
      EXPECT_LT((Vec3(theta.data() + 2) - pose.centre).norm(), 1e-14);
      const Eigen::Quaterniond q(theta[5], theta[6], theta[7], theta[8]);
      EXPECT_LT((q.normalized().toRotationMatrix() - pose.rotation).norm(), 1e-14);
    }
  }
}

TEST(ColliderMotion, ShapesComeFromTheScene) {
  const Scene capsule = scene_with(
      {"/colliders/finger/shape=capsule", "/colliders/finger/length=6 mm", "/colliders/finger/axis=[0,2,0]"});
  EXPECT_NEAR(collider_shape(capsule.colliders[0])->evaluate(Vec3(0, 9, 0)).gap, 1, 1e-14);
  const Scene ellipsoid =
      scene_with({"/colliders/finger/shape=ellipsoid", R"(/colliders/finger/semi_axes=["1 cm", 4, 5])"});
  EXPECT_NEAR(collider_shape(ellipsoid.colliders[0])->evaluate(Vec3(11, 0, 0)).gap, 1, 1e-14);
  EXPECT_THAT(refusal({"/colliders/finger/shape=ellipsoid"}), HasSubstr("semi_axes"));
  EXPECT_THAT(refusal({"/colliders/finger/axis=[0,0,0]"}), HasSubstr("/axis"));
  EXPECT_THAT(refusal({"/colliders/finger/shape=cone"}), HasSubstr("ellipsoid"));
}

TEST(ColliderMotion, RefusesAmbiguousTurns) {
  EXPECT_THAT(refusal({R"(/colliders/finger/path=[{"time": 0, "position": [0, 0, 6]},
      {"time": 1, "position": [2, 0, 6], "rotation": ["175 deg", 0, 0]}])"}),
              HasSubstr("put a knot between"));
  // The way round is taken as written: not the shorter one in silence, and a whole turn is none.
  EXPECT_EQ(refusal({R"(/colliders/finger/path=[{"time": 0, "position": [0, 0, 6]},
      {"time": 1, "position": [2, 0, 6], "rotation": [0, 0, "160 deg"]},
      {"time": 2, "position": [2, 0, 6], "rotation": [0, 0, "320 deg"]}])"}),
            "not refused");
  for (const std::string angle : {"300 deg", "360 deg", "-200 deg"})
    EXPECT_THAT(refusal({R"(/colliders/finger/path=[{"time": 0, "position": [0, 0, 6]},
        {"time": 1, "position": [2, 0, 6], "rotation": [0, 0, ")" +
                         angle + R"("]}])"}),
                HasSubstr("put a knot between"))
        << angle;
}

class PathFile : public testing::Test {
 protected:
  void SetUp() override {
    file_ = (std::filesystem::temp_directory_path() / ("rhytid_path_" + std::to_string(::getpid()) + ".csv"))
                .string();
  }
  void TearDown() override { std::filesystem::remove(file_); }
  std::vector<std::string> with(const std::string& text) const {
    std::ofstream(file_) << text;
    return {"/colliders/finger/path=null", "/colliders/finger/path_file=" + file_};
  }
  std::string file_;
};

TEST_F(PathFile, HoldsTimesPlacesAndOrientations) {
  const Scene scene =
      scene_with(with("# tracked\ntime_s, x_mm, y_mm, z_mm, qw, qx, qy, qz\n0, 1, 2, 3, 1, 0, 0, 0\r\n"
                      "0.5, 1, 2, 4, 0.70710678118654752, 0, 0, 0.70710678118654752\n"));
  const auto& path = scene.colliders[0].path;
  ASSERT_EQ(path.size(), 2u);
  EXPECT_EQ(path[1].time, 0.5);
  EXPECT_EQ(path[1].position, Vec3(1, 2, 4));
  EXPECT_LT((path[1].rotation - Vec3(0, 0, std::numbers::pi / 2)).norm(), 1e-15);
  // What a run records is whole without the file.
  const Scene again = parse_scene(scene_to_json(scene), "again.json");
  ASSERT_EQ(again.colliders[0].path.size(), 2u);
  EXPECT_EQ(again.colliders[0].path[1].rotation, path[1].rotation);
  // A finger that keeps turning passes half and whole turns.
  std::string turning = "time,x,y,z,qw,qx,qy,qz\n";
  for (int k = 0; k <= 12; ++k) {
    const double half = k * std::numbers::pi / 8;  // 45 degrees a knot
    // Its axis is not quite z, and the sign of a quaternion says nothing.
    const double sign = k % 3 == 0 ? -1 : 1;
    turning += std::to_string(k) + ",0,0,6," + std::to_string(sign * std::cos(half)) + "," +
               std::to_string(sign * 1e-4) + ",0," + std::to_string(sign * std::sin(half)) + "\n";
  }
  const Scene turns = scene_with(with(turning));
  EXPECT_NEAR(turns.colliders[0].path[4].rotation.norm(), std::numbers::pi, 1e-5);
  EXPECT_NEAR(turns.colliders[0].path[6].rotation.z(), -std::numbers::pi / 2, 1e-5);
  EXPECT_NO_THROW((void)parse_scene(scene_to_json(turns), "again.json"));
  EXPECT_EQ(scene_with(with("z,y,x,time\n3,2,1,0\n")).colliders[0].path[0].position, Vec3(1, 2, 3));
}

TEST_F(PathFile, IsRefusedByLine) {
  EXPECT_THAT(refusal(with("time,x,y\n0,1,2\n")), HasSubstr(":1"));
  EXPECT_THAT(refusal(with("time,x,y,w\n0,1,2,3\n")), HasSubstr("column"));
  EXPECT_NO_THROW(scene_with(with("time,x,y,z,sigma_x_mm,shared_xz,own_zz_mm2\n0,1,2,3,1,0,1\n")));
  for (const char* unknown : {"sigma_t", "own_x", "shared_zx", "own_"})
    EXPECT_THAT(refusal(with("time,x,y,z," + std::string(unknown) + "\n0,1,2,3,1\n")), HasSubstr("column"));
  EXPECT_THAT(refusal(with("time,x,y,z\n0,1,2,3\n0,1,2,3\n")), HasSubstr(":3"));
  EXPECT_THAT(refusal(with("time,x,y,z\n0,1,2\n")), HasSubstr("3 cells"));
  EXPECT_THAT(refusal(with("time,x,y,z\n0,1,2,nan\n")), HasSubstr("finite"));
  EXPECT_THAT(refusal(with("time,x,y,z,qw,qx,qy,qz\n0,1,2,3,1,1,0,0\n")), HasSubstr("quaternion"));
  EXPECT_THAT(refusal(with("time,x,y,z\n")), HasSubstr("no knots"));
  EXPECT_THAT(refusal({"/colliders/finger/path=null", "/colliders/finger/path_file=/nowhere.csv"}),
              HasSubstr("cannot be read"));
  EXPECT_THAT(refusal({"/colliders/finger/path_file=a.csv"}), HasSubstr("one of the two"));
}

}  // namespace
}  // namespace rhytid
