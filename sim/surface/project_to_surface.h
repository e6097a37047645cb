// Closest point of a triangle mesh: where a source given as a point in space sits on the surface.
#pragma once

#include <array>
#include <vector>

#include "sim/core/types.h"

namespace rhytid {

struct SurfacePoint {
  int triangle = -1;                ///< index into the triangles
  Vec3 barycentric = Vec3::Zero();  ///< weights of its three corners, ≥ 0, sum 1
  Vec3 point = Vec3::Zero();        ///< mm
  double distance = 0;              ///< |point − position|, mm
};

/// Closest point to `position` (mm) on the triangles; among distances that are equal within rounding (8 ε) the foot of a perpendicular wins
/// over a border's point, else the lowest triangle index. nodes [n][3] mm.
/// Degenerate triangles count as their edges. Brute force with box rejection, O(triangles) per call. Throws
/// ContractError when there is no triangle, an index is out of range or something is not finite.
SurfacePoint project_to_surface(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                                const Vec3& position);

/// Derivative of the closest point by the position, where `at` is the closest point to it: on a face I − n
/// nᵀ, on an edge that sticks out e eᵀ, at a corner 0 (between them it jumps).
Mat3 projection_derivative(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                           const Vec3& position, const SurfacePoint& at);

}  // namespace rhytid
