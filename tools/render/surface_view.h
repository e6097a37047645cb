// One frame of a moving surface as a camera sees it: pixels to material points and back, exactly, on the
// curved faces and not on the triangles that approximate them.
#pragma once

#include <optional>

#include "fitting/cameras.h"
#include "fitting/raycast.h"
#include "tools/render/moving_surface.h"

namespace rhytid::tools {

class SurfaceView {
 public:
  /// Both must outlive the view. `tessellation` is the surface's own.
  SurfaceView(const MovingSurface& surface, const SubdividedSurface& tessellation,
              const fitting::Camera& camera, int frame);

  /// The material point seen at a pixel, or nothing when the surface is not there or shows its back. The ray
  /// finds a triangle, Newton's method then solves project(x(u, v)) = pixel on the curved face.
  std::optional<MaterialPoint> pick(const Vec2& pixel) const;

  /// Pixel of a material point, px; NaN behind the camera.
  Vec2 project(const MaterialPoint& point) const;

  /// Whether the skin itself hides the point or turns it away (folds).
  bool is_hidden(const MaterialPoint& point) const;

 private:
  std::optional<MaterialPoint> cast(const fitting::Ray& ray) const;

  const MovingSurface& surface_;
  const SubdividedSurface& tessellation_;
  const fitting::Camera& camera_;
  int frame_;
  fitting::RayCaster caster_;
  double edge_;  ///< rest length of a typical sub-triangle's edge, mm
};

}  // namespace rhytid::tools
