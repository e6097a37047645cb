// Where a ray meets a triangle mesh: Embree finds the triangle in single precision, the intersection with
// that triangle is then computed in double precision, so that points are exact to round-off and not to 1e-7
// of the scene. Tests: tests/fitting/raycast_test.cpp
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "fitting/cameras.h"
#include "sim/core/types.h"

namespace rhytid::fitting {

/// A point of a mesh hit by a ray.
struct RayHit {
  int triangle = -1;  ///< index in the list given
  Vec3 barycentric;   ///< weights of the triangle's corners, each >= 0, sum 1
  double distance;    ///< along the ray's unit direction, mm
  Vec3 point;         ///< world, mm
  bool front_facing;  ///< the ray meets the side from which the corners run counter-clockwise
};

/// An immutable mesh ready for ray casts; cast() may be called from several threads at once.
class RayCaster {
 public:
  /// vertices [num_vertices][3] in mm; triangles index them. Throws ContractError on indices out of range or
  /// vertices that are not finite.
  RayCaster(const MatrixX3& vertices, std::vector<std::array<int, 3>> triangles);
  ~RayCaster();
  RayCaster(RayCaster&&) noexcept;
  RayCaster& operator=(RayCaster&&) noexcept;

  /// The nearest hit at distance > 0, or nothing. On an edge shared by triangles any one of them is returned.
  std::optional<RayHit> cast(const Ray& ray) const;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
};

}  // namespace rhytid::fitting
