#include "fitting/cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <opencv2/calib3d.hpp>
#include <random>

#include "sim/core/error.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Camera webcam() {
  Camera c;
  c.name = "webcam";
  c.intrinsics << 812.3, 0, 317.2, 0, 808.9, 244.1, 0, 0, 1;
  c.distortion = {-0.28, 0.11, 1.3e-3, -7e-4, -0.02};
  const Eigen::AngleAxisd turn(0.4, Vec3(1, -2, 0.5).normalized());
  c.rotation = turn.toRotationMatrix();
  c.translation = {12, -30, 420};
  c.width = 640;
  c.height = 480;
  return c;
}

/// World points that the camera sees.
std::vector<Vec3> visible_points(const Camera& c, int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> x(-0.35, 0.35), y(-0.27, 0.27), depth(200, 800);
  std::vector<Vec3> points;
  for (int i = 0; i < count; ++i) {
    const double z = depth(random);
    points.push_back(c.rotation.transpose() * (Vec3(x(random) * z, y(random) * z, z) - c.translation));
  }
  return points;
}

class CameraFile : public ::testing::Test {
 protected:
  std::string write(const std::string& text) const {
    std::ofstream(path_) << "%YAML:1.0\n---\n" << text;
    return path_;
  }
  std::string refusal(const std::string& text) const {
    try {
      read_camera(write(text));
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  }
  const test::TemporaryFolder folder_;
  const std::string path_ = folder_ / "camera.yml";
};

constexpr char kSize[] = "image_size: [ 640, 480 ]\n";
constexpr char kMatrix[] =
    "K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 800., 0., 320., 0., 800., 240., 0., "
    "0., 1. ]\n";

TEST(Camera, ProjectionAgreesWithOpenCv) {
  const Camera c = webcam();
  cv::Mat rvec;
  cv::Mat r(3, 3, CV_64F);
  for (int i = 0; i < 9; ++i) r.at<double>(i) = c.rotation(i / 3, i % 3);
  cv::Rodrigues(r, rvec);
  const cv::Matx33d k(c.intrinsics(0, 0), 0, c.intrinsics(0, 2), 0, c.intrinsics(1, 1), c.intrinsics(1, 2), 0,
                      0, 1);
  for (const Vec3& p : visible_points(c, 50)) {
    std::vector<cv::Point2d> expected;
    cv::projectPoints(std::vector<cv::Point3d>{{p.x(), p.y(), p.z()}}, rvec,
                      cv::Vec3d(c.translation.x(), c.translation.y(), c.translation.z()), k,
                      std::vector<double>(c.distortion.begin(), c.distortion.end()), expected);
    EXPECT_NEAR(c.project(p).x(), expected[0].x, 1e-9);
    EXPECT_NEAR(c.project(p).y(), expected[0].y, 1e-9);
  }
}

TEST(Camera, JacobianIsTheDerivative) {
  const Camera c = webcam();
  for (const Vec3& p : visible_points(c, 20)) {
    const auto jacobian = c.projection_jacobian(p);
    for (int axis = 0; axis < 3; ++axis) {
      double errors[2];
      for (int k = 0; k < 2; ++k) {
        const double h = k == 0 ? 2.0 : 1.0;
        Vec3 step = Vec3::Zero();
        step[axis] = h;
        errors[k] = ((c.project(p + step) - c.project(p - step)) / (2 * h) - jacobian.col(axis)).norm();
      }
      EXPECT_GT(jacobian.col(axis).norm(), 1e-3);
      // Central differences: the error falls fourfold; a wrong derivative leaves a constant.
      EXPECT_LT(errors[1], 0.3 * errors[0] + 1e-11);
    }
  }
}

TEST(Camera, PixelRayPassesThroughThePoint) {
  const Camera c = webcam();
  for (const Vec3& p : visible_points(c, 200)) {
    const Ray ray = c.pixel_ray(c.project(p));
    EXPECT_NEAR(ray.direction.norm(), 1, 1e-14);
    const Vec3 to_point = p - ray.origin;
    EXPECT_LT(to_point.cross(ray.direction).norm(), 1e-10);  // mm
    EXPECT_GT(to_point.dot(ray.direction), 0);
  }
}

TEST(Camera, RefusesPixelsBeyondTheFoldOfTheDistortion) {
  Camera c = webcam();
  c.distortion = {-0.3, 0, 0, 0, 0};  // r (1 − 0.3 r²) is largest at r = 1.054, value 0.703
  EXPECT_NO_THROW(c.pixel_ray({c.intrinsics(0, 2) + 0.70 * c.intrinsics(0, 0), c.intrinsics(1, 2)}));
  EXPECT_THROW(c.pixel_ray({c.intrinsics(0, 2) + 0.71 * c.intrinsics(0, 0), c.intrinsics(1, 2)}), InputError);
}

TEST(Camera, BehindTheCameraIsNotANumber) {
  const Camera c = webcam();
  const Vec3 behind = c.centre() - 10 * c.rotation.row(2).transpose();
  EXPECT_TRUE(std::isnan(c.project(behind).x()));
  EXPECT_TRUE(std::isnan(c.projection_jacobian(behind)(0, 0)));
}

TEST_F(CameraFile, ReadsBackTheSameBits) {
  const Camera c = webcam();
  write_camera(c, path_);
  const Camera d = read_camera(path_);
  EXPECT_EQ(d.name, c.name);
  EXPECT_EQ(d.intrinsics, c.intrinsics);
  EXPECT_EQ(d.distortion, c.distortion);
  EXPECT_EQ(d.rotation, c.rotation);
  EXPECT_EQ(d.translation, c.translation);
  EXPECT_EQ(d.width, 640);
  EXPECT_EQ(d.height, 480);
}

TEST_F(CameraFile, ReadsCalibrationStyleKeysRotationVectorsAndUnits) {
  std::string matrix = kMatrix;
  matrix.replace(0, 1, "camera_matrix");
  const Camera c = read_camera(
      write(matrix + "image_width: 640\nimage_height: 480\ndistortion_coefficients: [ -0.1, 0.02, 0., 0. ]\n"
                     "rvec: [ 0., 0., 1.5707963267948966 ]\ntvec: [ 0., 0.1, 0.5 ]\nlength_unit: m\n"));
  EXPECT_EQ(c.width, 640);
  EXPECT_EQ(c.distortion[0], -0.1);
  EXPECT_EQ(c.distortion[4], 0);
  EXPECT_NEAR((c.rotation * Vec3(1, 0, 0) - Vec3(0, 1, 0)).norm(), 0, 1e-15);
  EXPECT_EQ(c.translation, Vec3(0, 100, 500));
}

TEST_F(CameraFile, NamesWhatIsWrong) {
  EXPECT_THAT(refusal(kSize), AllOf(HasSubstr(path_), HasSubstr("K"), HasSubstr("nothing")));
  EXPECT_THAT(refusal(kMatrix), AllOf(HasSubstr("image_size"), HasSubstr("nothing")));
  EXPECT_THAT(refusal(std::string(kMatrix) + "image_size: [ 640.5, 480 ]\n"), HasSubstr("whole numbers"));
  EXPECT_THAT(refusal(std::string(kMatrix) + kSize + "D: [ 0.1, 0.2 ]\n"),
              AllOf(HasSubstr("D"), HasSubstr("2 coefficients")));
  EXPECT_THAT(refusal(std::string(kMatrix) + kSize + "D: [ 0.1, 0., 0., 0., 0., 0.5, 0., 0. ]\n"),
              HasSubstr("not supported"));
  EXPECT_THAT(refusal(std::string(kMatrix) + kSize + "D: [ 0.1, .Nan, 0., 0. ]\n"), HasSubstr("finite"));
  EXPECT_THAT(refusal(std::string(kMatrix) + kSize + "R: [ 1., 0., 0., 0., 1., 0., 0., 0., -1. ]\n"),
              HasSubstr("a rotation"));
  EXPECT_THAT(refusal(std::string(kMatrix) + kSize + "t: [ 1., 2. ]\n"), HasSubstr("3 values"));
  EXPECT_THAT(refusal(std::string(kMatrix) + kSize + "length_unit: inch\n"), HasSubstr("mm, cm or m"));
  EXPECT_THAT(refusal("K: [ 800, 0, 320 ]\n"), HasSubstr("3 x 3"));
  EXPECT_THAT(refusal("K: [ : :\n"), HasSubstr("OpenCV YAML"));
  EXPECT_THROW(read_camera("no_such_camera.yml"), InputError);
}

}  // namespace
}  // namespace rhytid::fitting
