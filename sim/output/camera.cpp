#include "sim/output/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/core/error.h"

namespace rhytid {

namespace {

/// Rows are the camera's x (right), y (down) and z (forward) axes in the world.
Mat3 orientation(const Vec3& forward, const Vec3& up) {
  const Vec3 z = forward.normalized();
  const Vec3 right = z.cross(up);
  require(z.allFinite() && right.norm() > 1e-9 * up.norm() && up.norm() > 0,
          "camera: view direction and up must be finite, non-zero and not parallel");
  const Vec3 x = right.normalized();
  Mat3 R;
  R << x.transpose(), z.cross(x).transpose(), z.transpose();
  return R;
}

Mat3 intrinsics(int width, int height, double vertical_field_of_view_deg) {
  require(width > 0 && height > 0, "camera: picture sizes must be positive");
  require(vertical_field_of_view_deg > 0 && vertical_field_of_view_deg < 180,
          "camera: field of view must be between 0 and 180 degrees");
  const double focal = 0.5 * height / std::tan(vertical_field_of_view_deg * std::numbers::pi / 360);
  Mat3 K;
  K << focal, 0, 0.5 * (width - 1), 0, focal, 0.5 * (height - 1), 0, 0, 1;
  return K;
}

}  // namespace

Vec3 PinholeCamera::project(const Vec3& world) const {
  const Vec3 c = to_camera(world);
  const Vec3 h = K * c;
  return {h.x() / h.z(), h.y() / h.z(), c.z()};
}

Vec3 PinholeCamera::ray(double x_px, double y_px) const {
  return (R.transpose() * (K.inverse() * Vec3(x_px, y_px, 1))).normalized();
}

PinholeCamera look_at(const Vec3& eye, const Vec3& target, const Vec3& up, int width, int height,
                      double vertical_field_of_view_deg) {
  PinholeCamera camera;
  camera.K = intrinsics(width, height, vertical_field_of_view_deg);
  camera.R = orientation(target - eye, up);
  camera.t = -camera.R * eye;
  camera.width = width;
  camera.height = height;
  return camera;
}

PinholeCamera frame_box(const Vec3& lower, const Vec3& upper, const Vec3& view_direction, const Vec3& up,
                        int width, int height, double vertical_field_of_view_deg, double margin) {
  require((upper - lower).minCoeff() >= 0 && (upper - lower).maxCoeff() > 0, "frame_box: empty box");
  require(margin >= 0 && margin < 0.5, "frame_box: margin must be in [0, 0.5)");
  PinholeCamera camera;
  camera.K = intrinsics(width, height, vertical_field_of_view_deg);
  camera.R = orientation(view_direction, up);
  camera.width = width;
  camera.height = height;

  // With the eye o and a corner c in the camera's axes, c is inside when |c.x − o.x| ≤ a (c.z − o.z): two
  // bounding planes through the extreme corners. Where they meet is the nearest admissible eye for that
  // picture axis; the farther of the two axes' depths wins, and the other axis stays centred.
  const Vec2 slope = (1 - 2 * margin) * Vec2(0.5 * width, 0.5 * height) / camera.K(0, 0);
  Vec2 plus = Vec2::Constant(-std::numeric_limits<double>::infinity()), minus = plus;
  double nearest = std::numeric_limits<double>::infinity();
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 world(corner & 1 ? upper.x() : lower.x(), corner & 2 ? upper.y() : lower.y(),
                     corner & 4 ? upper.z() : lower.z());
    const Vec3 c = camera.R * world;
    plus = plus.cwiseMax(c.head<2>() - slope * c.z());     // c.x − a c.z ≤ o.x − a o.z
    minus = minus.cwiseMax(-c.head<2>() - slope * c.z());  // −c.x − a c.z ≤ −o.x − a o.z
    nearest = std::min(nearest, c.z());
  }
  const Vec2 depth = -(plus + minus).cwiseQuotient(2 * slope);
  Vec3 eye;
  eye.head<2>() = 0.5 * (plus - minus);
  eye.z() = std::min(depth.minCoeff(), nearest - 1e-3 * (upper - lower).norm());
  camera.t = -eye;
  return camera;
}

}  // namespace rhytid
