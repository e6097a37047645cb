// The pose of a camera from landmarks: recovered exactly, with honest deviations, and with doubts where they are due.
#include "fitting/landmarks.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <random>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using testing::HasSubstr;

Camera lens() {
  Camera c;
  c.intrinsics << 1200, 0, 640, 0, 1190, 360, 0, 0, 1;
  c.distortion = {-0.2, 0.05, 1e-3, -5e-4, 0};
  c.width = 1280;
  c.height = 720;
  return c;
}

/// Some 300 mm before the camera, turned.
Camera posed() {
  Camera c = lens();
  c.rotation =
      (Eigen::AngleAxisd(3.0, Vec3::UnitX()) * Eigen::AngleAxisd(0.3, Vec3::UnitY())).toRotationMatrix();
  c.translation = {5, -10, 320};
  return c;
}

/// n points of a face-like bulge, `depth` mm deep; seeded.
std::vector<Landmark> landmarks(int n, double depth, unsigned seed, double noise = 0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-1, 1);
  std::normal_distribution<double> error;
  std::vector<Landmark> list;
  for (int i = 0; i < n; ++i) {
    Landmark l;
    l.name = "p" + std::to_string(i);
    const double x = place(random), y = place(random);
    l.point = {60 * x, 50 * y, depth * (1 - x * x - 0.5 * y * y)};
    l.sigma = noise > 0 ? noise : 1;
    l.pixel = posed().project(l.point) + noise * Vec2(error(random), error(random));
    list.push_back(l);
  }
  return list;
}

double angle_between(const Camera& a, const Camera& b) {
  return Eigen::AngleAxisd(Mat3(a.rotation * b.rotation.transpose())).angle();
}

TEST(Landmarks, ExactOnesGiveThePoseToRounding) {
  for (const int n : {4, 5, 8})
    for (const double depth : {40.0, 5.0}) {
      const PoseEstimate pose = estimate_pose(landmarks(n, depth, 3), lens(), "test");
      EXPECT_LT(angle_between(pose.camera, posed()), 1e-8) << n << " " << depth;
      EXPECT_LT((pose.camera.translation - posed().translation).norm(), 1e-5) << n << " " << depth;
      EXPECT_LT(pose.rms, 1e-7);
      EXPECT_EQ(pose.left_out.size(), n >= 5 ? n : 0);
    }
}

// Over many draws the errors have the stated covariance: the whitened square has the mean of chi-square with six
// degrees of freedom.
TEST(Landmarks, DeviationsAreThoseOfTheErrors) {
  double sum = 0, depth_square = 0, depth_variance = 0;
  const int draws = 300;
  for (int k = 0; k < draws; ++k) {
    const std::vector<Landmark> list = landmarks(10, 30, 100 + k, 1.5);
    const PoseEstimate pose = estimate_pose(list, lens(), "test");
    // (ω, τ) from the estimate to the truth, about the centroid.
    Vec3 middle = Vec3::Zero();
    for (const Landmark& l : list) middle += l.point / 10.0;
    const Eigen::AngleAxisd turn(Mat3(posed().rotation * pose.camera.rotation.transpose()));
    Eigen::Matrix<double, 6, 1> error;
    error << turn.angle() * turn.axis(), posed().rotation * middle + posed().translation -
                                             (pose.camera.rotation * middle + pose.camera.translation);
    // Without the widening, whose factor is never below one.
    const double widening = std::max(1.0, pose.reduced_chi_square);
    sum += widening * error.dot(pose.covariance.ldlt().solve(error));
    const Vec3 sight = (pose.camera.rotation * middle + pose.camera.translation).normalized();
    depth_square += std::pow(sight.dot(error.tail<3>()), 2);
    depth_variance += pose.depth_sigma * pose.depth_sigma / widening;
  }
  // Mean 6, deviation of the mean √(2·6/300) = 0.2.
  EXPECT_NEAR(sum / draws, 6, 0.7);
  EXPECT_NEAR(depth_square / depth_variance, 1, 0.25);
}

TEST(Landmarks, OneThatIsWrongIsNamed) {
  std::vector<Landmark> list = landmarks(9, 30, 7, 0.5);
  EXPECT_TRUE(estimate_pose(list, lens(), "test").doubts.empty());
  list[4].pixel += Vec2(25, -10);
  const PoseEstimate pose = estimate_pose(list, lens(), "test");
  ASSERT_EQ(pose.doubts.size(), 1);
  EXPECT_THAT(pose.doubts[0], HasSubstr("'p4' lies 2"));  // 27 px, to the noise
  EXPECT_NEAR(pose.left_out[4], std::hypot(25, 10), 4);
}

TEST(Landmarks, AnotherFaceIsDoubted) {
  std::vector<Landmark> list = landmarks(9, 30, 7, 0.5);
  for (std::size_t i = 0; i < list.size(); ++i) list[i].point.z() += i % 2 == 0 ? 12 : -12;
  const PoseEstimate pose = estimate_pose(list, lens(), "test");
  ASSERT_FALSE(pose.doubts.empty());
  EXPECT_THAT(pose.doubts.back(), HasSubstr("times their deviation"));
  EXPECT_GT(pose.reduced_chi_square, 9);
}

// Four leave two degrees of freedom, enough to see that they are off by far more than their deviation.
TEST(Landmarks, FourThatDoNotFitAreDoubted) {
  std::vector<Landmark> list = landmarks(4, 30, 7, 0.5);
  EXPECT_TRUE(estimate_pose(list, lens(), "test").doubts.empty());
  list[2].pixel += Vec2(30, -25);
  const PoseEstimate pose = estimate_pose(list, lens(), "test");
  EXPECT_GT(pose.reduced_chi_square, 4);
  EXPECT_TRUE(pose.left_out.empty());
  ASSERT_FALSE(pose.doubts.empty());
  EXPECT_THAT(pose.doubts.back(), HasSubstr("times their deviation"));
}

// Flat and far away: two tilts explain them, and the estimate says so.
TEST(Landmarks, TheOtherTiltOfAFlatSetIsNamed) {
  Camera far = posed();
  far.intrinsics(0, 0) = far.intrinsics(1, 1) = 12000;
  far.distortion = {};
  far.translation.z() = 3200;
  std::vector<Landmark> list = landmarks(8, 0, 5);
  std::mt19937 random(11);
  std::normal_distribution<double> error;
  for (Landmark& l : list) l.pixel = far.project(l.point) + Vec2(error(random), error(random));
  Camera unposed = far;
  unposed.rotation.setIdentity();
  unposed.translation.setZero();
  const PoseEstimate pose = estimate_pose(list, unposed, "test");
  ASSERT_FALSE(pose.doubts.empty());
  EXPECT_THAT(pose.doubts[0], HasSubstr("a pose tilted by"));
  // With depth there is only one.
  list = landmarks(8, 40, 5);
  for (Landmark& l : list) l.pixel = far.project(l.point);
  EXPECT_TRUE(estimate_pose(list, unposed, "test").doubts.empty());
}

TEST(Landmarks, TooFewOrOnALineAreRefused) {
  const auto message = [](const std::vector<Landmark>& list) {
    try {
      (void)estimate_pose(list, lens(), "marks.csv");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message(landmarks(3, 30, 1)), HasSubstr("marks.csv: got 3 landmarks, expected at least 4"));
  std::vector<Landmark> line = landmarks(6, 30, 1);
  for (std::size_t i = 0; i < line.size(); ++i) {
    line[i].point = Vec3(10.0 * static_cast<double>(i), 0, 0);
    line[i].pixel = posed().project(line[i].point);
  }
  EXPECT_THAT(message(line), HasSubstr("landmarks on a line"));
}

TEST(Landmarks, FileIsReadAndItsErrorsNamed) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "landmarks.csv";
  const auto vertex = [](long index) {
    if (index > 9) throw InputError("a vertex of the mesh, 0 to 9");
    return Vec3(static_cast<double>(index), 2, 3);
  };
  const auto read = [&](const std::string& text) {
    write_file(path, text);
    return read_landmarks(path, 2, vertex);
  };
  const auto message = [&](const std::string& text) {
    try {
      (void)read(text);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const auto list = read("# picked by hand\nvertex, name,x_px,y_px\r\n7,nose,10.5,20\r\n\n2,chin,-1,3\n");
  ASSERT_EQ(list.size(), 2);
  EXPECT_EQ(list[0].name, "nose");
  EXPECT_EQ(list[0].pixel, Vec2(10.5, 20));
  EXPECT_EQ(list[0].point, Vec3(7, 2, 3));
  EXPECT_EQ(list[0].sigma, 2);
  const auto placed = read("name,x_px,y_px,x_mm,y_mm,z_mm,sigma_px\na,1,2,3,4,5,0.5\n");
  EXPECT_EQ(placed[0].point, Vec3(3, 4, 5));
  EXPECT_EQ(placed[0].sigma, 0.5);
  const std::string header = "name,x_px,y_px,vertex\n";
  EXPECT_THAT(message(header + "a,1,x,3\n"), HasSubstr(path + ":2: got y_px 'x', expected a finite number"));
  EXPECT_THAT(message(header + "a,1,2,30\n"),
              HasSubstr(path + ":2: got vertex 30, expected a vertex of the mesh, 0 to 9"));
  EXPECT_THAT(message(header + "a,1,2,3\na,1,2,4\n"), HasSubstr(":3: got name 'a'"));
  EXPECT_THAT(message(header + "a,1,2\n"), HasSubstr(":2: got 3 fields, expected 4"));
  EXPECT_THAT(message("name,x_px,y_px\na,1,2\n"), HasSubstr(":1: got no column x_mm"));
  EXPECT_THAT(message("name,x_px,y_px,vertex\n"), HasSubstr("no landmark"));
  EXPECT_THAT(message("name,x,y_px,vertex\na,1,2,3\n"), HasSubstr(":1: got column 'x'"));
  EXPECT_THAT(message(header + "a,nan,2,3\n"), HasSubstr("x_px 'nan'"));
  EXPECT_THAT(message(""), HasSubstr("no landmark"));
  EXPECT_EQ(read(header + "Nasenfl\xc3\xbcgel,1,2,3\n")[0].name, "Nasenfl\xc3\xbcgel");
  EXPECT_THAT(message(header + "a,1,2,3\nNasenfl\xfcgel,1,2,3\n"),
              testing::AllOf(HasSubstr(path + ":3: got name 'Nasenfl"), HasSubstr("expected text in UTF-8")));
}

}  // namespace
}  // namespace rhytid::fitting
