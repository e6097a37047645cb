#include "tools/render/skin_camera.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace rhytid::tools {

fitting::Camera automatic_camera(const MovingSurface& surface, int width, int height, double tilt) {
  const Vec3 normal = surface.mean_normal();
  Vec3 up = Vec3::UnitY() - normal.y() * normal;
  if (up.norm() < 0.1) up = Vec3::UnitZ() - normal.z() * normal;
  up.normalize();
  const MatrixX3& rest = surface.mesh.rest;
  const Vec3 lower = rest.colwise().minCoeff().transpose(), upper = rest.colwise().maxCoeff().transpose();
  // Looking from below the picture's middle: the far side of the patch is up.
  const Vec3 view = -std::cos(tilt) * normal + std::sin(tilt) * up;
  const PinholeCamera framed = frame_box(lower, upper, view, up, width, height, 22, 0.03);
  fitting::Camera camera;
  camera.name = "camera";
  camera.intrinsics = framed.K, camera.rotation = framed.R, camera.translation = framed.t;
  camera.width = width, camera.height = height;
  return camera;
}

PinholeCamera pinhole(const fitting::Camera& camera) {
  return {.K = camera.intrinsics,
          .R = camera.rotation,
          .t = camera.translation,
          .width = camera.width,
          .height = camera.height};
}

bool has_distortion(const fitting::Camera& camera) {
  return std::any_of(camera.distortion.begin(), camera.distortion.end(), [](double k) { return k != 0; });
}

}  // namespace rhytid::tools
