#include "sim/scene/scene_surface.h"

#include <charconv>
#include <fstream>

#include "sim/core/error.h"

namespace rhytid {
namespace {

GridPattern grid_pattern(const std::string& name) {
  if (name == "diagonal_plus") return GridPattern::diagonal_plus;
  if (name == "diagonal_minus") return GridPattern::diagonal_minus;
  return GridPattern::union_jack;
}

TriangleSurface cropped(const TriangleSurface& mesh, const SurfaceScene& s) {
  if (s.crop_centre && s.crop_by == "distance") return crop_sphere(mesh, *s.crop_centre, s.crop_radius);
  if (s.crop_centre) return crop_geodesic_disc(mesh, *s.crop_centre, s.crop_radius);
  if (s.crop_low) return crop_box(mesh, *s.crop_low, *s.crop_high);
  if (!s.crop_vertices_file.empty())
    return crop_vertices(mesh, read_vertex_list(s.crop_vertices_file), s.crop_vertices_file);
  if (!s.crop_vertices.empty()) return crop_vertices(mesh, s.crop_vertices, "/skin/surface/crop/vertices");
  return mesh;
}

}  // namespace

std::vector<int> read_vertex_list(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw InputError(path, "a file that cannot be opened", "a readable list of vertex numbers");
  std::vector<int> indices;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    line.erase(std::min(line.find('#'), line.size()));
    const char *at = line.data(), *const end = at + line.size();
    for (;;) {
      while (at != end && (*at == ' ' || *at == '\t' || *at == '\r' || *at == ',')) ++at;
      if (at == end) break;
      int index = -1;
      const auto [after, status] = std::from_chars(at, end, index);
      const bool ends_well =
          after == end || *after == ' ' || *after == '\t' || *after == '\r' || *after == ',';
      if (status != std::errc() || !ends_well || index < 0)
        throw InputError(path + ":" + std::to_string(number), "'" + std::string(at, end).substr(0, 40) + "'",
                         "vertex numbers from 0");
      indices.push_back(index);
      at = after;
    }
  }
  if (indices.empty()) throw InputError(path + ": no vertex numbers");
  return indices;
}

TriangleSurface scene_surface(const SurfaceScene& s) {
  if (s.file.empty()) {
    const long faces = 2L * s.grid_cells[0] * s.grid_cells[1];
    if (faces > kMostFaces)
      throw InputError("/skin/surface/grid/cells", std::to_string(faces) + " faces",
                       "at most " + std::to_string(kMostFaces));
    return grid_surface(s.grid_size[0], s.grid_size[1], s.grid_cells[0], s.grid_cells[1],
                        grid_pattern(s.grid_pattern));
  }
  TriangleSurface mesh = read_surface(s.file, s.mm_per_unit > 0 ? s.mm_per_unit : 1);
  drop_unused_vertices(mesh);
  if (s.mm_per_unit == 0) refuse_doubtful_unit(mesh);
  // Texture seams double vertices in glTF, which knows no other way.
  const bool has_seams = mesh.format.starts_with("binary glTF");
  if (s.coincident == "join" || (s.coincident == "auto" && has_seams)) join_coincident_vertices(mesh);
  try {
    mesh = cropped(mesh, s);
  } catch (const InputError& error) {
    throw InputError(error.what() + giant_hint(mesh));
  }
  if (s.coincident == "auto") refuse_coincident_vertices(mesh);
  if (s.subdivide > 0) return subdivide_surface(mesh, s.subdivide);
  return mesh;
}

}  // namespace rhytid
