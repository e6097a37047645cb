#include "fitting/colmap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>

#include "fitting/case_camera.h"
#include "sim/core/error.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Colmap : public ::testing::Test {
 protected:
  const test::TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();

  void write(const std::string& cameras, const std::string& images) const {
    std::ofstream(folder_ + "/cameras.txt") << cameras;
    std::ofstream(folder_ + "/images.txt") << images;
  }
  Camera read(const std::string& image = "", double mm_per_unit = 1000) const {
    return read_colmap_camera(folder_, image, mm_per_unit);
  }
  std::string refusal(const std::string& image = "", double mm_per_unit = 1000) const {
    try {
      read(image, mm_per_unit);
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  }
};

constexpr char kImage[] = "1 1 0 0 0 0 0 2 1 a.jpg\n\n";

// By hand: X_c = (0.1, 0.2, 2), (x, y) = (0.05, 0.1), r² = 0.0125, 1 + 0.1 r² = 1.00125. COLMAP's pixel is
// (1000 · 0.0500625 + 320, 1000 · 0.100125 + 240), ours half a pixel less.
TEST_F(Colmap, ProjectsAsComputedByHand) {
  write("# a comment\n1 SIMPLE_RADIAL 640 480 1000 320 240 0.1\n",
        std::string("# two lines each\n") + kImage);
  const Camera c = read();
  const Vec2 pixel = c.project(Vec3(100, 200, 0));
  EXPECT_NEAR(pixel.x(), 370.0625 - 0.5, 1e-10);
  EXPECT_NEAR(pixel.y(), 340.125 - 0.5, 1e-10);
  EXPECT_EQ(c.name, "a");
  EXPECT_EQ(c.width, 640);
  EXPECT_EQ(c.height, 480);

  write("1 RADIAL 640 480 1000 320 240 0.1 2\n", kImage);  // 1 + 0.1 r² + 2 r⁴ = 1.0015625
  EXPECT_NEAR(read().project(Vec3(100, 200, 0)).y(), 100.15625 + 240 - 0.5, 1e-10);
  write("1 SIMPLE_PINHOLE 640 480 1000 320 240\n", kImage);
  EXPECT_NEAR(read().project(Vec3(100, 200, 0)).x(), 50 + 320 - 0.5, 1e-10);
  write("1 PINHOLE 640 480 1000 1100 320 240\n", kImage);
  EXPECT_NEAR(read().project(Vec3(100, 200, 0)).y(), 110 + 240 - 0.5, 1e-10);
}

// A quarter turn about z takes (0.2, −0.1, 0) to (0.1, 0.2, 0). With p1 = 0.01, p2 = −0.02:
// x_d = 0.0500625 + 2 · 0.01 · 0.005 − 0.02 (0.0125 + 0.005) = 0.0498125
// y_d = 0.100125 + 0.01 (0.0125 + 0.02) − 2 · 0.02 · 0.005 = 0.10025
TEST_F(Colmap, QuaternionIsWorldToCameraAndTangentialTermsAreOpenCvs) {
  write("7 OPENCV 640 480 1000 1100 320 240 0.1 0 0.01 -0.02\n",
        "3 0.70710678118654752 0 0 0.70710678118654752 0 0 2 7 left/a.jpg\n1 2 3\n"
        "4 1 0 0 0 0 0 2 7 right/a.jpg\n\n5 1 0 0 0 0 0 2 7 right/with blank.jpg\n\n");
  const Vec2 pixel = read("left/a.jpg").project(Vec3(200, -100, 0));
  EXPECT_NEAR(pixel.x(), 49.8125 + 320 - 0.5, 1e-9);
  EXPECT_NEAR(pixel.y(), 110.275 + 240 - 0.5, 1e-9);
  EXPECT_THAT(colmap_images(folder_), ElementsAre("left/a.jpg", "right/a.jpg", "right/with blank.jpg"));
  EXPECT_EQ(read("with blank.jpg").name, "with blank");
  EXPECT_THAT(refusal("a.jpg"),
              AllOf(HasSubstr("images.txt"), HasSubstr("of two images"), HasSubstr("right/a.jpg")));
  EXPECT_THAT(refusal("b.jpg"), AllOf(HasSubstr("no image 'b.jpg'"), HasSubstr("left/a.jpg")));
  EXPECT_THAT(refusal(""), HasSubstr("3 images"));
}

TEST_F(Colmap, WhatIsWrittenReadsBackToTheSameView) {
  std::vector<Camera> cameras(3);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    Camera& c = cameras[i];
    c.name = "view" + std::to_string(i) + ".png";
    c.intrinsics << 812.3, 0, 317.2, 0, 808.9, 244.1, 0, 0, 1;
    if (i > 0) c.distortion = {-0.28, 0.11, 1.3e-3, -7e-4, i == 2 ? -0.02 : 0};
    c.rotation =
        Eigen::AngleAxisd(0.4 + 2 * static_cast<double>(i), Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
    c.translation = {12, -30, 420};
    c.width = 640;
    c.height = 480;
  }
  write_colmap_cameras(cameras, folder_, 12.5);
  std::string text((std::istreambuf_iterator<char>(std::ifstream(folder_ + "/cameras.txt").rdbuf())), {});
  EXPECT_THAT(text,
              AllOf(HasSubstr("1 PINHOLE 640"), HasSubstr("2 OPENCV 640"), HasSubstr("3 FULL_OPENCV 640")));
  for (const Camera& c : cameras) {
    const Camera back = read(c.name, 12.5);
    const Vec3 X = c.rotation.transpose() * (Vec3(70, -40, 300) - c.translation);
    EXPECT_LT((back.project(X) - c.project(X)).norm(), 1e-9);
    EXPECT_LT((back.centre() - c.centre()).norm(), 1e-9);
    EXPECT_EQ(back.distortion, c.distortion);
    EXPECT_EQ(back.width, 640);
  }
  cameras[1].name = "view0.png";
  EXPECT_THROW(write_colmap_cameras(cameras, folder_, 1), InputError);
}

TEST_F(Colmap, ScaleIsOfEveryLength) {
  write("1 PINHOLE 640 480 1000 1100 320 240\n", kImage);
  EXPECT_LT((read("", 3).centre() - Vec3(0, 0, -6)).norm(), 1e-12);
  EXPECT_THAT(refusal("", 0), HasSubstr("mm per unit"));
}

TEST_F(Colmap, IsTheCameraOfACase) {
  write("1 PINHOLE 640 480 1000 1100 320 240\n", kImage);
  Case c;
  c.file = "case.json";
  c.camera = folder_;
  const auto refused = [&c] {
    try {
      read_case_camera(c);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("accepted");
  };
  EXPECT_THAT(refused(), HasSubstr("case.json: /camera_unit: got nothing"));
  c.view_pointer = "/clips/1";
  EXPECT_THAT(refused(), HasSubstr("case.json: /clips/1/camera_unit: got nothing"));
  c.camera_unit = 10;
  const std::string out = folder_ + "/out";
  std::filesystem::create_directories(out);
  EXPECT_EQ(case_camera_file(c, out), out + "/camera.yaml");  // results keep their camera
  EXPECT_LT((read_camera(out + "/camera.yaml").centre() - Vec3(0, 0, -20)).norm(), 1e-12);
  c.camera = out + "/camera.yaml";
  EXPECT_THAT(refused(), HasSubstr("/camera_image and /camera_unit"));
  c.camera_unit.reset();
  EXPECT_EQ(read_case_camera(c).width, 640);
}

TEST_F(Colmap, RefusesMalformedFilesWithTheirLine) {
  const std::string good = "1 PINHOLE 640 480 1000 1100 320 240\n";
  const auto cameras = [&](const std::string& line) {
    write("# first\n" + line, kImage);
    return refusal();
  };
  const auto images = [&](const std::string& line) {
    write(good, "# first\n\n" + line);
    return refusal();
  };
  EXPECT_THAT(cameras("1 FISHEYE 640 480 1 2 3\n"),
              AllOf(HasSubstr("cameras.txt:2: got model FISHEYE, expected"), HasSubstr("OPENCV")));
  EXPECT_THAT(cameras("1 PINHOLE 640 480 1000 320 240\n"),
              HasSubstr("cameras.txt:2: got 3 parameters, expected 4"));
  EXPECT_THAT(cameras("1 PINHOLE 640 480 1000 x 320 240\n"), HasSubstr("'x', expected a finite number"));
  EXPECT_THAT(cameras("1 PINHOLE 640 480 1000 -1 320 240\n"), HasSubstr("positive"));
  EXPECT_THAT(cameras("1 PINHOLE 0 480 1000 1000 320 240\n"), HasSubstr("0 x 480 px"));
  EXPECT_THAT(cameras("1 FULL_OPENCV 640 480 1000 1000 320 240 0 0 0 0 0 0.1 0 0\n"), HasSubstr("k4"));
  EXPECT_THAT(cameras("2 PINHOLE 640 480 1000 1100 320 240\n"), HasSubstr("no camera 1"));
  EXPECT_THAT(cameras("1 PINHOLE\n"), HasSubstr("too few words"));
  EXPECT_THAT(images("1 1 0 0 0 0 0 2 1\n"), HasSubstr("images.txt:3: got 9 words, expected IMAGE_ID"));
  EXPECT_THAT(images("1 0.5 0 0 0 0 0 2 1 a.jpg\n"), HasSubstr("a quaternion of length 0.5"));
  EXPECT_THAT(images("1 1 0 0 0 0 0 nan 1 a.jpg\n"), HasSubstr("TZ 'nan'"));
  EXPECT_THAT(images("1 1 0 0 0 0 0 2 1.5 a.jpg\n"), HasSubstr("a whole number"));
  EXPECT_THAT(images(""), HasSubstr("no images"));
  // Without the lines of points every second image would be taken for points.
  EXPECT_THAT(images("1 1 0 0 0 0 0 2 1 a.jpg\n2 1 0 0 0 0 0 2 1 b.jpg\n"),
              AllOf(HasSubstr("images.txt:4: got '2 1 0"), HasSubstr("points of the image above")));
  EXPECT_THAT(images("1 1 0 0 0 0 0 2 1 a.jpg\n1 2 3 4\n"), HasSubstr("images.txt:4: got '1 2 3 4'"));
  EXPECT_EQ(images("1 1 0 0 0 0 0 2 1 a.jpg\n1.5 2 -1  4 5e1 6 \n"), "accepted");
  EXPECT_EQ(images("1 1 0 0 0 0 0 2 1 a.jpg"), "accepted");
  std::filesystem::remove(folder_ + "/cameras.txt");
  EXPECT_FALSE(is_colmap(folder_));
  EXPECT_THROW(read(), InputError);
}

}  // namespace
}  // namespace rhytid::fitting
