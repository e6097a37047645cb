#include <cstdio>

#include "sim/core/error.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {

TriangleSurface grid_surface(double size_x, double size_y, int nx, int ny, GridPattern pattern) {
  require(size_x > 0 && size_y > 0, "grid_surface: the size must be positive");
  require(nx >= 1 && ny >= 1, "grid_surface: at least one cell each way is needed");
  TriangleSurface grid;
  char origin[96];
  std::snprintf(origin, sizeof origin, "grid of %g x %g mm, %d x %d cells", size_x, size_y, nx, ny);
  grid.origin = origin;
  grid.vertices.resize((nx + 1) * (ny + 1), 3);
  const auto vertex = [nx](int i, int j) { return j * (nx + 1) + i; };
  for (int j = 0; j <= ny; ++j) {
    for (int i = 0; i <= nx; ++i) {
      // Written about the middle so that the grid is symmetric to the last bit.
      grid.vertices.row(vertex(i, j)) << size_x * (2 * i - nx) / (2. * nx), size_y * (2 * j - ny) / (2. * ny),
          0;
      grid.source_vertex.push_back(vertex(i, j));
    }
  }
  for (int j = 0; j < ny; ++j) {
    for (int i = 0; i < nx; ++i) {
      const int a = vertex(i, j), b = vertex(i + 1, j), c = vertex(i + 1, j + 1), d = vertex(i, j + 1);
      const bool plus =
          pattern == GridPattern::diagonal_plus || (pattern == GridPattern::union_jack && (i + j) % 2 == 0);
      if (plus) {
        grid.faces.push_back({a, b, c});
        grid.faces.push_back({a, c, d});
      } else {
        grid.faces.push_back({a, b, d});
        grid.faces.push_back({b, c, d});
      }
    }
  }
  return grid;
}

}  // namespace rhytid
