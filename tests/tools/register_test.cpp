// `rhytid register` in the test's own process: pose, files, messages.
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "fitting/cameras.h"
#include "sim/mesh/triangle_surface.h"
#include "sim/output/atomic_file.h"
#include "tests/support/small_scenes.h"
#include "tests/support/temporary_folder.h"
#include "tests/tools/program_call.h"
#include "tools/verb.h"

namespace rhytid::tools {

std::unique_ptr<Verb> make_verb_register();

namespace {

using testing::HasSubstr;

/// A folder with the drag scene, a case, and a lens; landmarks are vertices of the scene's grid.
class Place {
 public:
  Place() {
    write_file(at("scene.json"), test::drag_scene(1, 1));
    write_file(at("case.json"), R"({"scene": "scene.json", "camera": "lens.yaml"})");
    camera.intrinsics << 900, 0, 320, 0, 900, 240, 0, 0, 1;
    camera.distortion = {-0.1, 0, 0, 0, 0};
    camera.width = 640;
    camera.height = 480;
    fitting::write_camera(camera, at("lens.yaml"));
    camera.rotation =
        (Eigen::AngleAxisd(2.6, Vec3::UnitX()) * Eigen::AngleAxisd(0.4, Vec3::UnitY())).toRotationMatrix();
    camera.translation = {1, -1, 40};
  }
  std::string at(const std::string& file) const { return folder_ / file; }

  /// Every fourth vertex of the grid, where the camera sees it; "wrong" is off by 9 px.
  std::string landmarks(bool with_wrong) const {
    const TriangleSurface grid = grid_surface(16, 12, 5, 4, GridPattern::union_jack);
    std::string text = "name,vertex,x_px,y_px\n";
    int count = 0;
    for (int v = 0; v < grid.vertices.rows(); v += 4, ++count) {
      const Vec2 p =
          camera.project(grid.vertices.row(v).transpose()) + Vec2(0, with_wrong && count == 3 ? 9 : 0);
      std::ostringstream line;
      line.precision(12);
      line << (with_wrong && count == 3 ? "wrong" : "v" + std::to_string(v)) << ',' << v << ',' << p.x()
           << ',' << p.y() << '\n';
      text += line.str();
    }
    return text;
  }

  Outcome call(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"register", at("case.json"), "--landmarks", at("landmarks.csv"),
                                          "-o",       at("out")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return call_program(arguments, make_verb_register());
  }

  fitting::Camera camera;

 private:
  test::TemporaryFolder folder_;
};

TEST(Register, PlacesTheCameraAndDrawsTheMesh) {
  const Place place;
  write_file(place.at("landmarks.csv"), place.landmarks(false));
  const Outcome call = place.call();
  ASSERT_EQ(call.code, 0) << call.err;
  const fitting::Camera found = fitting::read_camera(place.at("out/camera.yaml"));
  EXPECT_LT((found.rotation - place.camera.rotation).norm(), 1e-8);
  EXPECT_LT((found.translation - place.camera.translation).norm(), 1e-6);
  EXPECT_EQ(found.distortion, place.camera.distortion);
  EXPECT_THAT(call.out, HasSubstr("landmark"));
  EXPECT_THAT(call.out, HasSubstr("mm along the line of sight"));
  const auto json = nlohmann::json::parse(read_file(place.at("out/registration.json")));
  EXPECT_LT(json["rms_px"], 1e-6);
  const cv::Mat picture = cv::imread(place.at("out/registration.png"));
  ASSERT_EQ(picture.size(), cv::Size(640, 480));
  // The mesh is drawn where the first landmark lies, and nothing far from it.
  const Vec2 corner = place.camera.project(Vec3(-8, -6, 0));
  const cv::Rect around(static_cast<int>(corner.x()) - 12, static_cast<int>(corner.y()) - 12, 24, 24);
  EXPECT_LT(cv::mean(picture(around))[0], 254);
  EXPECT_EQ(cv::mean(picture(cv::Rect(0, 0, 20, 20)))[0], 255);
}

TEST(Register, NamesTheLandmarkThatIsWrong) {
  const Place place;
  write_file(place.at("landmarks.csv"), place.landmarks(true));
  const Outcome call = place.call({"--sigma", "0.5"});
  EXPECT_EQ(call.code, 3);  // the pose is written, and doubtful
  EXPECT_THAT(call.err, HasSubstr("warning: doubtful pose: 'wrong' lies 9"));
  EXPECT_TRUE(std::filesystem::exists(place.at("out/camera.yaml")));
  EXPECT_THAT(call.out, HasSubstr("Doubt: 'wrong' lies 9"));
}

TEST(Register, DoubtsACameraBehindTheSkin) {
  Place place;
  // A grid has no depth: seen from behind is as good as mirrored, which y counted from below does.
  std::istringstream lines(place.landmarks(false));
  std::string text, line;
  std::getline(lines, text);
  text += "\n";
  while (std::getline(lines, line)) {
    const auto comma = line.rfind(',');
    text += line.substr(0, comma + 1) + std::to_string(480 - std::stod(line.substr(comma + 1))) + "\n";
  }
  write_file(place.at("landmarks.csv"), text);
  const Outcome call = place.call();
  EXPECT_EQ(call.code, 3);
  EXPECT_THAT(call.out, HasSubstr("Doubt: the camera sees the patch from behind"));
}

TEST(Register, BadInputIsOneLineAndLeavesNothing) {
  const Place place;
  const auto error = [&](const std::string& text, const std::vector<std::string>& more = {}) {
    write_file(place.at("landmarks.csv"), text);
    const Outcome call = place.call(more);
    EXPECT_EQ(call.code, 2) << call.err;
    EXPECT_EQ(std::count(call.err.begin(), call.err.end(), '\n'), 1) << call.err;
    EXPECT_FALSE(std::filesystem::exists(place.at("out")));
    return call.err;
  };
  EXPECT_THAT(error("name,x_px,y_px,vertex\na,1,2,999\n"),
              HasSubstr("landmarks.csv:2: got vertex 999, expected a vertex of the mesh, 0 to "));
  EXPECT_THAT(error("name,x_px,y_px,vertex\na,1,2,0\nb,30,2,4\nc,5,60,9\n"), HasSubstr("got 3 landmarks"));
  EXPECT_THAT(error(place.landmarks(false), {"--image", place.at("none.png")}), HasSubstr("none.png"));
  cv::imwrite(place.at("small.png"), cv::Mat(48, 64, CV_8UC3, cv::Scalar(0, 0, 0)));
  EXPECT_THAT(error(place.landmarks(false), {"--image", place.at("small.png")}),
              HasSubstr("small.png: got 64 x 48 px, expected 640 x 480 px"));
  write_file(place.at("case.json"), R"({"scene": "scene.json"})");
  EXPECT_THAT(error(place.landmarks(false)), HasSubstr("/camera: got nothing"));
}

}  // namespace
}  // namespace rhytid::tools
