#include "tools/report/skin_view.h"

#include <algorithm>
#include <cmath>

#include "sim/output/picture.h"

namespace rhytid::tools {

int picture_subdivision(const SkinMesh& mesh) {
  // About 200 edges across the picture show no corners; more only cost time.
  const double faces_across = std::sqrt(0.5 * std::max(1, mesh.num_faces));
  return static_cast<int>(std::clamp(std::round(200 / faces_across), 2.0, 24.0));
}

PinholeCamera skin_view(const SubdividedSurface& surface, const std::optional<fitting::Camera>& camera,
                        int width, int height, int reserved_right) {
  const MatrixX3 positions = surface.positions({});
  PinholeCamera view;
  if (camera) {
    view = frame_box(positions.colwise().minCoeff(), positions.colwise().maxCoeff(),
                     camera->rotation.row(2).transpose(), -camera->rotation.row(1).transpose(),
                     width - reserved_right, height);
  } else {
    const MatrixX3 normals = surface.normals({});
    PictureOptions options;
    options.width = width - reserved_right;
    options.height = height;
    view = three_quarter_view(positions, normals.colwise().sum().transpose(), options);
  }
  view.width = width;
  view.height = height;
  return view;
}

PinholeCamera footage_view(const fitting::Camera& camera, int width) {
  PinholeCamera view;
  const double scale = static_cast<double>(width) / camera.width;
  view.K = camera.intrinsics;
  // Pixel centres are at whole numbers, so edges scale and centres do not: x' + ½ = s (x + ½).
  view.K.row(0) *= scale;
  view.K.row(1) *= scale;
  view.K(0, 2) += 0.5 * scale - 0.5;
  view.K(1, 2) += 0.5 * scale - 0.5;
  view.R = camera.rotation;
  view.t = camera.translation;
  view.width = width;
  view.height = std::max(1, static_cast<int>(std::lround(scale * camera.height)));
  return view;
}

}  // namespace rhytid::tools
