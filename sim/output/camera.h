// The pinhole camera of pictures and rendered footage, in OpenCV's conventions.
#pragma once

#include "sim/core/types.h"

namespace rhytid {

/// World-to-camera pinhole: X_c = R X + t, axes x right, y down, z forward; pixel = K X_c / z. Pixel (i, j)
/// has its centre at the coordinates (i, j) and covers [i − ½, i + ½] × [j − ½, j + ½].
struct PinholeCamera {
  Mat3 K = Mat3::Identity();  ///< intrinsics, px; last row (0, 0, 1)
  Mat3 R = Mat3::Identity();
  Vec3 t = Vec3::Zero();      ///< mm
  int width = 0, height = 0;  ///< px

  Vec3 to_camera(const Vec3& world) const { return R * world + t; }
  /// (x px, y px, depth z mm); x and y mean something only for depth > 0.
  Vec3 project(const Vec3& world) const;
  /// The optical centre in the world, mm.
  Vec3 centre() const { return -R.transpose() * t; }
  /// Unit direction in the world of the ray through a pixel position.
  Vec3 ray(double x_px, double y_px) const;
};

/// A camera at `eye` that looks at `target`; `up` points up in the picture. Throws ContractError when the
/// directions are degenerate, sizes are not positive or the field of view is outside (0, 180) degrees.
PinholeCamera look_at(const Vec3& eye, const Vec3& target, const Vec3& up, int width, int height,
                      double vertical_field_of_view_deg);

/// A camera that looks along `view_direction` and is as near as it can be with the whole box inside the
/// picture, `margin` (fraction of the picture) free on each side. Box corners in mm.
PinholeCamera frame_box(const Vec3& lower, const Vec3& upper, const Vec3& view_direction, const Vec3& up,
                        int width, int height, double vertical_field_of_view_deg = 22, double margin = 0.05);

}  // namespace rhytid
