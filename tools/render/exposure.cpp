#include "tools/render/exposure.h"

#include <algorithm>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid::tools {

VectorXd displacement_between(const MovingSurface& surface, double frame) {
  const int last = surface.frames() - 1, f = static_cast<int>(std::floor(frame));
  require(frame >= -1 && frame <= last + 1, "displacement_between: more than a frame beyond the ends");
  if (frame <= 0) return surface.displacements[0];
  const auto at = [&](int i) -> VectorXd {
    const auto& u = surface.displacements;
    if (i <= last || last == 0) return u[static_cast<size_t>(std::clamp(i, 0, last))];
    return u[static_cast<size_t>(last)] +
           (i - last) * (u[static_cast<size_t>(last)] - u[static_cast<size_t>(last - 1)]);
  };
  const double w = frame - f, w2 = w * w, w3 = w2 * w;
  return (-w3 + 2 * w2 - w) / 2 * at(f - 1) + (3 * w3 - 5 * w2 + 2) / 2 * at(f) +
         (-3 * w3 + 4 * w2 + w) / 2 * at(f + 1) + (w3 - w2) / 2 * at(f + 2);
}

double time_between(const MovingSurface& surface, double frame) {
  const auto& t = surface.times;
  if (t.size() == 1) return t[0];
  const int f = std::clamp(static_cast<int>(std::floor(frame)), 0, surface.frames() - 2);
  return t[static_cast<size_t>(f)] +
         (frame - f) * (t[static_cast<size_t>(f) + 1] - t[static_cast<size_t>(f)]);
}

int pictures_of_exposure(const MovingSurface& surface, const fitting::Camera& camera, double exposure) {
  if (exposure == 0) return 1;
  double fastest = 0;  // px per frame
  const auto place = [&](int frame, int column) {
    const Vec3 x = surface.mesh.rest.row(column).transpose() +
                   surface.displacements[static_cast<size_t>(frame)].segment<3>(3 * column);
    return camera.project(x);
  };
  for (int frame = 1; frame < surface.frames(); ++frame)
    for (int column = 0; column < surface.mesh.num_columns; ++column)
      fastest = std::max(fastest, (place(frame, column) - place(frame - 1, column)).norm());
  return std::clamp(static_cast<int>(std::ceil(exposure * fastest)), 2, 64);
}

MovingSurface exposed_surface(const MovingSurface& surface, double exposure, int pictures) {
  require(exposure >= 0 && exposure <= 1 && pictures >= 1, "exposed_surface: exposure or pictures");
  MovingSurface out{surface.mesh, {}, {}, surface.scene};
  for (int f = 0; f < surface.frames(); ++f)
    for (int k = 0; k < pictures; ++k) {
      const double at = f + exposure * ((k + 0.5) / pictures - 0.5);
      out.times.push_back(time_between(surface, at));
      out.displacements.push_back(displacement_between(surface, at));
    }
  return out;
}

}  // namespace rhytid::tools
