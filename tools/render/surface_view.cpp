#include "tools/render/surface_view.h"

#include <Eigen/LU>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid::tools {

SurfaceView::SurfaceView(const MovingSurface& surface, const SubdividedSurface& tessellation,
                         const fitting::Camera& camera, int frame)
    : surface_(surface),
      tessellation_(tessellation),
      camera_(camera),
      frame_(frame),
      caster_(tessellation.positions(surface.displacements[static_cast<size_t>(frame)]),
              tessellation.triangles()) {
  double sum = 0;
  const MatrixX3 rest = tessellation.positions({});
  for (const auto& t : tessellation.triangles()) sum += (rest.row(t[0]) - rest.row(t[1])).norm();
  edge_ = sum / static_cast<double>(tessellation.triangles().size());
}

std::optional<MaterialPoint> SurfaceView::cast(const fitting::Ray& ray) const {
  const auto hit = caster_.cast(ray);
  if (!hit || !hit->front_facing) return std::nullopt;
  MaterialPoint point{tessellation_.face_of_triangle(hit->triangle), 0, 0};
  for (int i = 0; i < 3; ++i) {
    const auto& vertex = tessellation_.vertices()[static_cast<size_t>(
        tessellation_.triangles()[static_cast<size_t>(hit->triangle)][static_cast<size_t>(i)])];
    point.u += hit->barycentric[i] * vertex.u;
    point.v += hit->barycentric[i] * vertex.v;
  }
  return point;
}

std::optional<MaterialPoint> SurfaceView::pick(const Vec2& pixel) const {
  std::optional<MaterialPoint> point;
  try {
    point = cast(camera_.pixel_ray(pixel));
  } catch (const InputError&) {  // a pixel beyond the fold of the distortion model
    return std::nullopt;
  }
  if (!point) return std::nullopt;
  for (int iteration = 0; iteration < 20; ++iteration) {
    Vec3 x_u, x_v;
    const Vec3 x = surface_.position(*point, frame_, &x_u, &x_v);
    const Vec2 error = pixel - camera_.project(x);
    if (error.norm() < 1e-11 * camera_.width) return point;
    const Eigen::Matrix<double, 2, 3> P = camera_.projection_jacobian(x);
    Eigen::Matrix2d J;
    J << P * x_u, P * x_v;
    const Vec2 step = J.inverse() * error;
    if (!step.allFinite() || step.norm() > 0.5) return std::nullopt;
    point->u += step.x(), point->v += step.y();
  }
  return std::nullopt;
}

Vec2 SurfaceView::project(const MaterialPoint& point) const {
  return camera_.project(surface_.position(point, frame_));
}

bool SurfaceView::is_hidden(const MaterialPoint& point) const {
  const Vec3 x = surface_.position(point, frame_), eye = camera_.centre();
  const auto seen = cast({eye, (x - eye).normalized()});
  // The ray may pass the triangles near a silhouette, or meet a neighbour of the point's own.
  return !seen || (surface_.rest(*seen) - surface_.rest(point)).norm() > 2 * edge_;
}

}  // namespace rhytid::tools
