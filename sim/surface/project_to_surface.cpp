#include "sim/surface/project_to_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/core/error.h"

namespace rhytid {
namespace {

struct ClosestPoint {
  Vec3 barycentric;
  bool is_foot;  ///< of a perpendicular, not a point of the border that is nearest to one outside
};

/// The closest point of the triangle to x.
ClosestPoint closest_point(const std::array<Vec3, 3>& corner, const Vec3& x) {
  const Vec3 u = corner[1] - corner[0], v = corner[2] - corner[0], d = x - corner[0];
  const Vec3 normal = u.cross(v);
  const double n2 = normal.squaredNorm();
  // Interior: the foot of the perpendicular. A sliver whose area is round-off of its edges has no normal.
  if (n2 > 1e-28 * u.squaredNorm() * v.squaredNorm()) {
    const double beta = d.cross(v).dot(normal) / n2, gamma = u.cross(d).dot(normal) / n2;
    if (beta >= 0 && gamma >= 0 && beta + gamma <= 1) return {Vec3(1 - beta - gamma, beta, gamma), true};
  }
  Vec3 best = Vec3::Zero();
  double best_d2 = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    const Vec3& from = corner[static_cast<std::size_t>(k)];
    const Vec3 edge = corner[static_cast<std::size_t>(next)] - from;
    const double length2 = edge.squaredNorm();
    const double s = length2 > 0 ? std::clamp(edge.dot(x - from) / length2, 0.0, 1.0) : 0.0;
    const double d2 = (from + s * edge - x).squaredNorm();
    if (d2 >= best_d2) continue;
    best_d2 = d2;
    best.setZero();
    best[k] = 1 - s;
    best[next] = s;
  }
  return {best, false};
}

}  // namespace

SurfacePoint project_to_surface(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                                const Vec3& position) {
  require(!triangles.empty(), "project_to_surface: no triangles");
  require(position.allFinite() && nodes.allFinite(), "project_to_surface: coordinates must be finite");
  // At height d above a face its neighbour's border is farther away by x²/2d only where x is the way to it: nothing,
  // in floating point, for x up to √ε d. Among equal distances the foot of a perpendicular is right.
  constexpr double kTie = 8 * std::numeric_limits<double>::epsilon();
  SurfacePoint best;
  best.distance = std::numeric_limits<double>::infinity();
  bool is_foot = false;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    std::array<Vec3, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) {
      require(triangles[t][k] >= 0 && triangles[t][k] < nodes.rows(),
              "project_to_surface: triangle index out of range");
      corner[k] = nodes.row(triangles[t][k]).transpose();
    }
    const Vec3 low = corner[0].cwiseMin(corner[1]).cwiseMin(corner[2]);
    const Vec3 high = corner[0].cwiseMax(corner[1]).cwiseMax(corner[2]);
    const double box_distance = (low - position).cwiseMax(position - high).cwiseMax(0.0).norm();
    if (box_distance > best.distance * (1 + kTie)) continue;
    const ClosestPoint found = closest_point(corner, position);
    const Vec3& weights = found.barycentric;
    const Vec3 point = weights[0] * corner[0] + weights[1] * corner[1] + weights[2] * corner[2];
    const double distance = (point - position).norm();
    const bool is_nearer = found.is_foot && !is_foot ? distance <= best.distance * (1 + kTie)
                                                     : distance < best.distance * (is_foot ? 1 - kTie : 1);
    if (!is_nearer) continue;
    best = {static_cast<int>(t), weights, point, distance};
    is_foot = found.is_foot;
  }
  return best;
}

Mat3 projection_derivative(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                           const Vec3& position, const SurfacePoint& at) {
  constexpr double kRounding = 1e-9;  // of the way to the surface, or of the triangle
  const std::array<int, 3>& t = triangles[static_cast<std::size_t>(at.triangle)];
  const auto corner = [&](int k) { return Vec3(nodes.row(t[static_cast<std::size_t>(k)]).transpose()); };
  const Vec3 u = corner(1) - corner(0), v = corner(2) - corner(0), normal = u.cross(v).normalized();
  const Vec3 way = position - at.point;
  // Straight above the face, its edges included: then it is a face's closest point on one side at least.
  const double sideways = (way - way.dot(normal) * normal).norm();
  if (sideways <= kRounding * std::max(way.norm(), u.norm()) && normal.allFinite())
    return Mat3::Identity() - normal * normal.transpose();
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3, other = (k + 2) % 3;
    if (at.barycentric[other] > 0 || at.barycentric[k] <= 0 || at.barycentric[next] <= 0) continue;
    const Vec3 edge = (corner(next) - corner(k)).normalized();
    return edge * edge.transpose();
  }
  return Mat3::Zero();
}

}  // namespace rhytid
