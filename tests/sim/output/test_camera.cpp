#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "sim/core/error.h"
#include "sim/output/camera.h"

namespace rhytid {
namespace {

TEST(PinholeCamera, ProjectAndRayAreInverse) {
  const PinholeCamera camera = look_at({30, -40, 50}, {1, 2, 3}, Vec3::UnitZ(), 640, 480, 35);
  EXPECT_NEAR((camera.R * camera.R.transpose() - Mat3::Identity()).norm(), 0, 1e-14);
  EXPECT_NEAR(camera.R.determinant(), 1, 1e-14);
  EXPECT_NEAR((camera.centre() - Vec3(30, -40, 50)).norm(), 0, 1e-12);
  const Vec3 target = camera.project({1, 2, 3});
  EXPECT_NEAR(target.x(), 319.5, 1e-10);
  EXPECT_NEAR(target.y(), 239.5, 1e-10);
  EXPECT_NEAR(target.z(), (Vec3(30, -40, 50) - Vec3(1, 2, 3)).norm(), 1e-12);
  const Vec3 point = camera.centre() + 17 * camera.ray(100.25, 33.5);
  const Vec3 pixel = camera.project(point);
  EXPECT_NEAR(pixel.x(), 100.25, 1e-10);
  EXPECT_NEAR(pixel.y(), 33.5, 1e-10);
  // Up in the world is up in the picture, where y points down.
  EXPECT_LT(camera.project({1, 2, 4}).y(), target.y());
}

TEST(PinholeCamera, FieldOfViewReachesTheEdgeOfThePicture) {
  const PinholeCamera camera = look_at({0, 0, 10}, {0, 0, 0}, Vec3::UnitY(), 200, 100, 90);
  // 45° above the axis is the upper edge, half a pixel above the centre of the first row.
  EXPECT_NEAR(camera.project({0, 10, 0}).y(), -0.5, 1e-10);
}

TEST(PinholeCamera, RefusesDegenerateViews) {
  EXPECT_THROW(look_at({0, 0, 1}, {0, 0, 1}, Vec3::UnitY(), 10, 10, 30), ContractError);
  EXPECT_THROW(look_at({0, 0, 1}, {0, 0, 0}, Vec3::UnitZ(), 10, 10, 30), ContractError);
  EXPECT_THROW(look_at({0, 0, 1}, {0, 0, 0}, Vec3::UnitY(), 10, 10, 180), ContractError);
  EXPECT_THROW(frame_box({0, 0, 0}, {0, 0, 0}, Vec3::UnitX(), Vec3::UnitZ(), 10, 10), ContractError);
}

TEST(FrameBox, IsTightAndHonoursTheMargin) {
  const Vec3 lower(-10, 5, 2), upper(20, 9, 3);
  for (const Vec3& direction : {Vec3(-1, -1, -1), Vec3(0.2, 1, -0.3), Vec3(0, 0, -1)}) {
    for (const auto& [width, height] : {std::pair{800, 300}, {300, 800}}) {
      const double margin = 0.1;
      const PinholeCamera camera =
          frame_box(lower, upper, direction, Vec3(0, 0.9, 0.5), width, height, 30, margin);
      double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
      for (int k = 0; k < 8; ++k) {
        const Vec3 corner(k & 1 ? upper.x() : lower.x(), k & 2 ? upper.y() : lower.y(),
                          k & 4 ? upper.z() : lower.z());
        const Vec3 pixel = camera.project(corner);
        EXPECT_GT(pixel.z(), 0);
        x0 = std::min(x0, pixel.x()), x1 = std::max(x1, pixel.x());
        y0 = std::min(y0, pixel.y()), y1 = std::max(y1, pixel.y());
      }
      // Free margins as fractions of the picture, whose first pixel begins at −½.
      const double left = (x0 + 0.5) / width, right = (width - 0.5 - x1) / width;
      const double top = (y0 + 0.5) / height, bottom = (height - 0.5 - y1) / height;
      const double tightest_x = std::min(left, right), tightest_y = std::min(top, bottom);
      EXPECT_NEAR(std::min(tightest_x, tightest_y), margin, 1e-9);
      const bool x_rules = tightest_x < tightest_y;
      EXPECT_NEAR(x_rules ? left : top, x_rules ? right : bottom, 1e-9) << "touches both sides";
    }
  }
}

}  // namespace
}  // namespace rhytid
