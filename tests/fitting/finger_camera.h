// The camera of the tests that look for a finger: distorted, some 50 mm above the skin, 18 px per mm.
#pragma once

#include <Eigen/Geometry>

#include "fitting/cameras.h"

namespace rhytid::fitting {

inline Camera finger_camera() {
  Camera camera;
  camera.intrinsics << 926, 0, 322, 0, 921, 241, 0, 0, 1;
  camera.distortion = {-0.12, 0.05, 0.001, -0.002, 0};
  camera.rotation =
      (Eigen::AngleAxisd(2.5, Vec3::UnitX()) * Eigen::AngleAxisd(0.2, Vec3::UnitY())).toRotationMatrix();
  camera.translation = {0.5, -1, 52};
  camera.width = 640;
  camera.height = 480;
  return camera;
}

}  // namespace rhytid::fitting
