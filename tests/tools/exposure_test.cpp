// Between the frames of a moving surface: cubics are met, ends behave as stated, exposures are cut evenly.
#include "tools/render/exposure.h"

#include <gtest/gtest.h>

namespace rhytid::tools {
namespace {

/// One column that moves along x(t) in x, mm, at 25 frames a second.
template <typename Path>
MovingSurface one_column(int frames, const Path& x) {
  MovingSurface surface;
  surface.mesh.num_columns = 1;
  surface.mesh.rest = MatrixX3::Zero(1, 3);
  for (int f = 0; f < frames; ++f) {
    surface.times.push_back(0.04 * f);
    VectorXd u = VectorXd::Zero(3);
    u[0] = x(f);
    surface.displacements.push_back(u);
  }
  return surface;
}

fitting::Camera camera_above(double pixels_per_mm) {
  fitting::Camera camera;
  camera.width = 640, camera.height = 480;
  camera.intrinsics << 1000, 0, 320, 0, 1000, 240, 0, 0, 1;
  camera.rotation = Vec3(1, -1, -1).asDiagonal();
  camera.translation = Vec3(0, 0, 1000 / pixels_per_mm);
  return camera;
}

TEST(Exposure, BetweenFramesASmoothMotionIsMet) {
  const auto x = [](double t) { return 0.3 * t * t - 0.1 * t; };
  const MovingSurface surface = one_column(7, x);
  for (const double t : {1.0, 2.3, 3.5, 4.9}) {
    EXPECT_NEAR(displacement_between(surface, t)[0], x(t), 1e-12) << t;
    EXPECT_NEAR(time_between(surface, t), 0.04 * t, 1e-12);
  }
}

TEST(Exposure, AtRestBeforeTheFirstFrameAndStraightOnAfterTheLast) {
  const MovingSurface surface = one_column(4, [](double t) { return 2 * t; });
  EXPECT_EQ(displacement_between(surface, -0.9)[0], 0);
  EXPECT_NEAR(displacement_between(surface, 3.4)[0], 6.8, 1e-12);
  EXPECT_NEAR(time_between(surface, -0.5), -0.02, 1e-12);
  EXPECT_NEAR(time_between(surface, 3.5), 0.14, 1e-12);
  const MovingSurface still = one_column(1, [](double) { return 3.; });
  EXPECT_EQ(displacement_between(still, 0.5)[0], 3);
  EXPECT_EQ(time_between(still, 0.5), 0);
}

TEST(Exposure, PicturesAreInTheMiddlesOfItsParts) {
  const MovingSurface surface = one_column(5, [](double t) { return t; });
  const MovingSurface exposed = exposed_surface(surface, 0.6, 3);
  ASSERT_EQ(exposed.frames(), 15);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(exposed.displacements[static_cast<size_t>(3 * 2 + k)][0], 2 + 0.2 * (k - 1), 1e-12);
    EXPECT_NEAR(exposed.times[static_cast<size_t>(3 * 2 + k)], 0.04 * (2 + 0.2 * (k - 1)), 1e-12);
  }
  // A closed shutter is the surface itself, to the bit.
  const MovingSurface closed = exposed_surface(surface, 0, 1);
  for (int f = 0; f < 5; ++f) {
    EXPECT_EQ(closed.displacements[static_cast<size_t>(f)], surface.displacements[static_cast<size_t>(f)]);
    EXPECT_EQ(closed.times[static_cast<size_t>(f)], surface.times[static_cast<size_t>(f)]);
  }
}

TEST(Exposure, SoManyPicturesThatNothingJumpsByMoreThanAPixel) {
  const MovingSurface surface =
      one_column(3, [](double t) { return 0.9 * t; });  // 9 px a frame at 10 px per mm
  EXPECT_EQ(pictures_of_exposure(surface, camera_above(10), 0.5), 5);
  EXPECT_EQ(pictures_of_exposure(surface, camera_above(10), 0.01), 2);
  EXPECT_EQ(pictures_of_exposure(surface, camera_above(10), 0), 1);
  EXPECT_EQ(pictures_of_exposure(surface, camera_above(1000), 1), 64);
}

}  // namespace
}  // namespace rhytid::tools
