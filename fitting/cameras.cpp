#include "fitting/cameras.h"

#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <sstream>
#include <vector>

#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::fitting {
namespace {

/// Distorted point and its derivative with respect to the undistorted (x, y).
struct Distorted {
  Vec2 value;
  Eigen::Matrix2d jacobian;
};

Distorted distort(const std::array<double, 5>& d, const Vec2& point) {
  const auto& [k1, k2, p1, p2, k3] = d;
  const double x = point.x(), y = point.y(), r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double radial_slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3));  // ∂radial/∂x = radial_slope · x
  Distorted out;
  out.value << x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
      y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  out.jacobian(0, 0) = radial + radial_slope * x * x + 2 * p1 * y + 6 * p2 * x;
  out.jacobian(0, 1) = radial_slope * x * y + 2 * p1 * x + 2 * p2 * y;
  out.jacobian(1, 0) = out.jacobian(0, 1);
  out.jacobian(1, 1) = radial + radial_slope * y * y + 6 * p1 * y + 2 * p2 * x;
  return out;
}

std::string describe(const cv::Mat& m) {
  return std::to_string(m.rows) + " x " + std::to_string(m.cols) + " values";
}

/// The first of `keys` that the file has, as a double matrix (empty when none is there).
cv::Mat read_matrix(const cv::FileStorage& file, const std::string& path,
                    const std::vector<std::string>& keys, std::string* found_key) {
  for (const std::string& key : keys) {
    const cv::FileNode node = file[key];
    if (node.empty()) continue;
    *found_key = key;
    cv::Mat m;
    try {
      if (node.isSeq()) {
        std::vector<double> values;
        for (const cv::FileNode& item : node) {
          if (!item.isReal() && !item.isInt())
            throw InputError(path + ": " + key, "a list with text", "numbers");
          values.push_back(static_cast<double>(item));
        }
        m = cv::Mat(values, true);
      } else if (node.isMap()) {
        node >> m;
      }
      if (!m.empty()) m.convertTo(m, CV_64F);
    } catch (const cv::Exception&) {
      m.release();
    }
    if (m.empty() || m.channels() != 1)
      throw InputError(path + ": " + key, "no numbers", "an OpenCV matrix or list");
    if (!cv::checkRange(m))
      throw InputError(path + ": " + key, "a value that is not finite", "finite numbers");
    return m;
  }
  return {};
}

Mat3 as_mat3(const cv::Mat& m) {
  const cv::Mat flat = m.reshape(1, 9);
  Mat3 out;
  for (int i = 0; i < 9; ++i) out(i / 3, i % 3) = flat.at<double>(i);
  return out;
}

Vec3 as_vec3(const cv::Mat& m) {
  const cv::Mat flat = m.reshape(1, 3);
  return {flat.at<double>(0), flat.at<double>(1), flat.at<double>(2)};
}

void read_intrinsics(const cv::FileStorage& file, const std::string& path, Camera* camera) {
  std::string key = "K";
  const cv::Mat k = read_matrix(file, path, {"K", "camera_matrix"}, &key);
  if (k.empty()) throw InputError(path + ": K", "nothing", "a 3 x 3 camera matrix (key K or camera_matrix)");
  if (k.total() != 9) throw InputError(path + ": " + key, describe(k), "3 x 3");
  camera->intrinsics = as_mat3(k);
  const Mat3& K = camera->intrinsics;
  if (!(K(0, 0) > 0 && K(1, 1) > 0))
    throw InputError(path + ": " + key,
                     "focal lengths " + std::to_string(K(0, 0)) + ", " + std::to_string(K(1, 1)),
                     "positive focal lengths in px");
  if (K(0, 1) != 0 || K(1, 0) != 0 || K(2, 0) != 0 || K(2, 1) != 0 || K(2, 2) != 1)
    throw InputError(path + ": " + key, "a skewed or scaled matrix", "[fx 0 cx; 0 fy cy; 0 0 1]");

  key = "D";
  const cv::Mat d = read_matrix(file, path, {"D", "distortion", "distortion_coefficients"}, &key);
  for (std::size_t i = 0; i < d.total(); ++i) {
    const double value = d.reshape(1, static_cast<int>(d.total())).at<double>(static_cast<int>(i));
    if (i < 5)
      camera->distortion[i] = value;
    else if (value != 0)
      throw InputError(path + ": " + key, std::to_string(d.total()) + " coefficients",
                       "k1 k2 p1 p2 [k3] (rational and tilted models are not supported)");
  }
  if (!d.empty() && d.total() < 4)
    throw InputError(path + ": " + key, std::to_string(d.total()) + " coefficients", "k1 k2 p1 p2 [k3]");
}

void read_pose(const cv::FileStorage& file, const std::string& path, Camera* camera) {
  std::string key = "R";
  cv::Mat r = read_matrix(file, path, {"R", "rvec"}, &key);
  if (!r.empty()) {
    if (r.total() == 3) cv::Rodrigues(r.reshape(1, 3).clone(), r);
    if (r.total() != 9) throw InputError(path + ": " + key, describe(r), "3 x 3 or a rotation vector of 3");
    camera->rotation = as_mat3(r);
    // 1e-3 leaves room for hand-typed four-digit matrices; anything worse is not a rotation.
    const double error = (camera->rotation * camera->rotation.transpose() - Mat3::Identity()).norm();
    if (error > 1e-3 || camera->rotation.determinant() < 0)
      throw InputError(path + ": " + key,
                       "|R Rᵀ - I| = " + std::to_string(error) +
                           ", det R = " + std::to_string(camera->rotation.determinant()),
                       "a rotation (orthogonal, determinant +1)");
  }
  key = "t";
  const cv::Mat t = read_matrix(file, path, {"t", "tvec", "T"}, &key);
  if (!t.empty()) {
    if (t.total() != 3) throw InputError(path + ": " + key, describe(t), "3 values");
    camera->translation = as_vec3(t);
  }
  double mm_per_unit = 1;
  if (!file["length_unit"].empty()) {
    const std::string unit =
        file["length_unit"].isString() ? static_cast<std::string>(file["length_unit"]) : "a number";
    if (unit == "m")
      mm_per_unit = 1000;
    else if (unit == "cm")
      mm_per_unit = 10;
    else if (unit != "mm")
      throw InputError(path + ": length_unit", "'" + unit + "'", "mm, cm or m");
  }
  camera->translation *= mm_per_unit;
}

void read_image_size(const cv::FileStorage& file, const std::string& path, Camera* camera) {
  std::string key = "image_size";
  const cv::Mat size = read_matrix(file, path, {"image_size"}, &key);
  double width = 0, height = 0;
  if (!size.empty()) {
    if (size.total() != 2) throw InputError(path + ": image_size", describe(size), "[width, height]");
    width = size.reshape(1, 2).at<double>(0);
    height = size.reshape(1, 2).at<double>(1);
  } else if (!file["image_width"].empty() && !file["image_height"].empty()) {
    width = static_cast<double>(file["image_width"]);
    height = static_cast<double>(file["image_height"]);
  } else {
    throw InputError(path + ": image_size", "nothing", "[width, height] in px");
  }
  if (!(width >= 1 && height >= 1 && width <= 1e5 && height <= 1e5) || width != std::floor(width) ||
      height != std::floor(height))
    throw InputError(path + ": image_size", std::to_string(width) + " x " + std::to_string(height),
                     "whole numbers of px from 1 to 100000");
  camera->width = static_cast<int>(width);
  camera->height = static_cast<int>(height);
}

template <class Matrix>
cv::Mat to_cv(const Matrix& m) {
  cv::Mat out(static_cast<int>(m.rows()), static_cast<int>(m.cols()), CV_64F);
  for (int i = 0; i < m.rows(); ++i)
    for (int j = 0; j < m.cols(); ++j) out.at<double>(i, j) = m(i, j);
  return out;
}

}  // namespace

Vec2 Camera::project(const Vec3& X) const {
  const Vec3 c = rotation * X + translation;
  if (!(c.z() > 0)) return Vec2::Constant(std::numeric_limits<double>::quiet_NaN());
  const Vec2 d = distort(distortion, c.head<2>() / c.z()).value;
  return {intrinsics(0, 0) * d.x() + intrinsics(0, 2), intrinsics(1, 1) * d.y() + intrinsics(1, 2)};
}

Eigen::Matrix<double, 2, 3> Camera::projection_jacobian(const Vec3& X) const {
  const Vec3 c = rotation * X + translation;
  if (!(c.z() > 0)) return Eigen::Matrix<double, 2, 3>::Constant(std::numeric_limits<double>::quiet_NaN());
  const Vec2 n = c.head<2>() / c.z();
  Eigen::Matrix<double, 2, 3> dn_dc;  // ∂(X_c/Z_c, Y_c/Z_c)/∂X_c
  dn_dc << 1 / c.z(), 0, -n.x() / c.z(), 0, 1 / c.z(), -n.y() / c.z();
  const Vec2 focal(intrinsics(0, 0), intrinsics(1, 1));
  return focal.asDiagonal() * distort(distortion, n).jacobian * dn_dc * rotation;
}

Vec2 Camera::undistorted(const Vec2& pixel) const {
  const Vec2 target((pixel.x() - intrinsics(0, 2)) / intrinsics(0, 0),
                    (pixel.y() - intrinsics(1, 2)) / intrinsics(1, 1));
  Vec2 n = target;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Distorted d = distort(distortion, n);
    const Vec2 residual = d.value - target;
    // 4 ulp at the scale of the image plane: the residual cannot be made smaller.
    if (residual.norm() <= 4 * std::numeric_limits<double>::epsilon() * (1 + target.norm()) &&
        d.jacobian.determinant() > 0)
      return n;
    if (!(d.jacobian.determinant() > 0)) break;
    Vec2 step = d.jacobian.inverse() * residual;
    // The model is meant for |n| of order 1; long steps only happen next to a fold, where they would jump
    // over it.
    if (step.norm() > 0.5) step *= 0.5 / step.norm();
    n -= step;
    if (step.norm() <= 2 * std::numeric_limits<double>::epsilon() * n.norm()) return n;
  }
  std::ostringstream where, found;
  where << "camera '" << name << "': pixel_ray";
  found << "pixel (" << pixel.x() << ", " << pixel.y() << ")";
  throw InputError(where.str(), found.str(), "a pixel where the distortion model is invertible");
}

Ray Camera::pixel_ray(const Vec2& pixel) const {
  const Vec2 n = undistorted(pixel);
  return {centre(), rotation.transpose() * Vec3(n.x(), n.y(), 1).normalized()};
}

Camera read_camera(const std::string& path) {
  if (!std::filesystem::exists(path)) throw InputError(path, "no such file", "a camera in OpenCV YAML");
  cv::FileStorage file;
  try {
    file.open(path, cv::FileStorage::READ);
  } catch (const cv::Exception& e) {
    throw InputError(path, "unreadable text (" + e.err + ")", "a camera in OpenCV YAML");
  }
  if (!file.isOpened()) throw InputError(path, "an unreadable file", "a camera in OpenCV YAML");
  Camera camera;
  camera.name = std::filesystem::path(path).stem().string();
  try {
    if (file["name"].isString()) camera.name = static_cast<std::string>(file["name"]);
    read_intrinsics(file, path, &camera);
    read_pose(file, path, &camera);
    read_image_size(file, path, &camera);
  } catch (const cv::Exception& e) {
    throw InputError(path, "malformed content (" + e.err + ")", "a camera in OpenCV YAML");
  }
  return camera;
}

std::string camera_digest(const Camera& camera) {
  Digest d;
  d.text(camera.name);
  d.number(camera.width);
  d.number(camera.height);
  d.matrix(camera.intrinsics);
  for (const double x : camera.distortion) d.number(x);
  d.matrix(camera.rotation);
  d.matrix(camera.translation);
  return d.hex();
}

void write_camera(const Camera& camera, const std::string& path) {
  AtomicPath target(path);
  {
    cv::FileStorage file;  // chooses the format by the extension
    try {
      file.open(target.path(), cv::FileStorage::WRITE);
    } catch (const cv::Exception&) {
    }
    if (!file.isOpened())
      throw InputError(path, "a file that cannot be written", "a writable .yml, .yaml, .xml or .json");
    file << "name" << camera.name;
    file << "image_size" << std::vector<int>{camera.width, camera.height};
    file << "K" << to_cv(camera.intrinsics);
    const auto& d = camera.distortion;
    file << "D" << cv::Mat(std::vector<double>(d.begin(), d.end()), true);
    file << "R" << to_cv(camera.rotation);
    file << "t" << to_cv(camera.translation);
    file << "length_unit"
         << "mm";
  }
  target.commit();
}

}  // namespace rhytid::fitting
