#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "sim/core/error.h"
#include "sim/output/picture.h"

namespace rhytid {

PictureSolid capsule_solid(const Vec3& a, const Vec3& b, double radius) {
  require(radius > 0, "capsule_solid: radius must be positive");
  constexpr int around = 64, quarter = 16;
  const Vec3 axis = (b - a).norm() > 1e-12 * radius ? Vec3((b - a).normalized()) : Vec3(Vec3::UnitZ());
  const Vec3 side = axis.cross(Vec3::Unit(std::abs(axis.x()) < 0.8 ? 0 : 1)).normalized(),
             third = axis.cross(side);

  // Rings of latitude from the pole at a to the pole at b; the equator appears twice, once at each end.
  PictureSolid solid;
  constexpr int rings = 2 * (quarter + 1);
  solid.vertices.resize(rings * around, 3);
  solid.normals.resize(rings * around, 3);
  for (int ring = 0; ring < rings; ++ring) {
    const bool at_b = ring > quarter;
    const double latitude = std::numbers::pi / 2 * (double(ring - (at_b ? 1 : 0)) / quarter - 1);
    for (int k = 0; k < around; ++k) {
      const double longitude = 2 * std::numbers::pi * k / around;
      const Vec3 normal = std::cos(latitude) * (std::cos(longitude) * side + std::sin(longitude) * third) +
                          std::sin(latitude) * axis;
      solid.normals.row(ring * around + k) = normal.transpose();
      solid.vertices.row(ring * around + k) = ((at_b ? b : a) + radius * normal).transpose();
    }
  }
  for (int ring = 0; ring + 1 < rings; ++ring) {
    for (int k = 0; k < around; ++k) {
      const int next = (k + 1) % around, low = ring * around, high = low + around;
      solid.triangles.push_back({low + k, low + next, high + next});
      solid.triangles.push_back({low + k, high + next, high + k});
    }
  }
  return solid;
}

PictureSolid ellipsoid_solid(const Vec3& centre, const Mat3& rotation, const Vec3& semi_axes) {
  require(semi_axes.minCoeff() > 0, "ellipsoid_solid: semi-axes must be positive");
  PictureSolid solid = capsule_solid(Vec3::Zero(), Vec3::Zero(), 1);
  for (Eigen::Index i = 0; i < solid.vertices.rows(); ++i) {
    const Vec3 on_ball = solid.vertices.row(i).transpose();
    solid.vertices.row(i) = (centre + rotation * semi_axes.cwiseProduct(on_ball)).transpose();
    solid.normals.row(i) = (rotation * on_ball.cwiseQuotient(semi_axes)).normalized().transpose();
  }
  return solid;
}

}  // namespace rhytid
