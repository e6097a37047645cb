// Pinhole camera with Brown-Conrady distortion, in OpenCV's conventions.
//
//   X_c = R X + t,   (x, y) = (X_c, Y_c) / Z_c,   r² = x² + y²
//   x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
//   y_d = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y
//   px  = (fx x_d + cx, fy y_d + cy)
//
// Source  OpenCV 4 calib3d, "Detailed Description" (the five-coefficient model).
// Units   world mm; pixels with integer values at pixel centres, x right, y down, camera looks along +z.
// Tests   tests/fitting/cameras_test.cpp
#pragma once

#include <array>
#include <string>

#include "sim/core/types.h"

namespace rhytid::fitting {

/// Half line origin + s·direction, s >= 0; direction has unit length, world mm.
struct Ray {
  Vec3 origin;
  Vec3 direction;
};

/// One calibrated view.
struct Camera {
  std::string name = "camera";
  Mat3 intrinsics = Mat3::Identity();     ///< K: fx 0 cx; 0 fy cy; 0 0 1, px
  std::array<double, 5> distortion = {};  ///< k1 k2 p1 p2 k3
  Mat3 rotation = Mat3::Identity();       ///< R, world to camera
  Vec3 translation = Vec3::Zero();        ///< t, world to camera, mm
  int width = 0, height = 0;              ///< image size, px

  /// Image of the world point X (mm). Outside its domain (Z_c <= 0: behind the camera) both values are NaN.
  Vec2 project(const Vec3& X) const;

  /// ∂(px)/∂X, shape [2][3], px/mm, distortion included. NaN where project() is.
  Eigen::Matrix<double, 2, 3> projection_jacobian(const Vec3& X) const;

  /// The ray of all world points seen at `pixel`: inverts the distortion by Newton's method to round-off.
  /// Throws InputError when the distortion has no inverse there (a pixel beyond the fold of the model).
  Ray pixel_ray(const Vec2& pixel) const;

  /// The same ray's direction before rotation: undistorted (x, y) at Z_c = 1.
  Vec2 undistorted(const Vec2& pixel) const;

  /// Optical centre −Rᵀt, mm.
  Vec3 centre() const { return -rotation.transpose() * translation; }
};

/// Reads OpenCV FileStorage YAML/XML/JSON: `K` or `camera_matrix` [3][3]; `D`, `distortion` or
/// `distortion_coefficients` (0, 4 or 5 numbers; higher-order models are refused unless the rest is zero);
/// `R` [3][3] or Rodrigues vector, or `rvec`; `t` or `tvec`; `image_size` [width, height] or `image_width`
/// and `image_height`; `length_unit` "mm" (default), "cm" or "m" for t; `name` (default: file stem). Missing
/// R and t mean the camera frame is the world frame. Throws InputError naming file and key.
Camera read_camera(const std::string& path);

/// Digest of everything in it, by which saved work knows its camera, whatever file or folder it came from.
std::string camera_digest(const Camera& camera);

/// Writes what read_camera() reads, all digits, under a temporary name that is renamed when complete.
/// Throws InputError when the file cannot be written.
void write_camera(const Camera& camera, const std::string& path);

}  // namespace rhytid::fitting
