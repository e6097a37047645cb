#include "sim/mesh/surface_builder.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "sim/core/error.h"

namespace rhytid {

namespace {
constexpr const char* kMeshFile = "a readable mesh file (.obj, .ply, .glb or .msh)";
}

void require_mesh_file(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return;
  throw InputError(path, std::filesystem::exists(path, error) ? "what is no file" : "no file there",
                   kMeshFile);
}

std::string read_mesh_bytes(const std::string& path) {
  require_mesh_file(path);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path, "a file that cannot be opened", kMeshFile);
  std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) throw InputError(path + ": reading failed");
  return bytes;
}

SurfaceBuilder::SurfaceBuilder(std::string path, double mm_per_unit, int first_number)
    : path_(std::move(path)), mm_per_unit_(mm_per_unit), first_number_(first_number) {
  require(mm_per_unit > 0 && std::isfinite(mm_per_unit), "SurfaceBuilder: mm_per_unit must be positive");
}

void SurfaceBuilder::add_polygon(const std::vector<long>& corners) {
  require(corners.size() >= 3, "SurfaceBuilder: a polygon needs three corners");
  for (std::size_t k = 2; k < corners.size(); ++k) {
    triangles_.push_back({corners[0], corners[k - 1], corners[k]});
    source_face_.push_back(num_polygons_);
  }
  ++polygons_of_size_[corners.size()];
  ++num_polygons_;
}

TriangleSurface SurfaceBuilder::finish(const std::string& format) {
  const long count = num_vertices();
  if (count == 0) throw InputError(path_ + ": no vertices; is it a mesh in " + format + " format?");
  if (triangles_.empty()) throw InputError(path_ + ": no faces");
  if (std::max<std::size_t>(vertices_.size(), triangles_.size()) > kMostFaces)
    throw InputError(path_ + ": more than " + std::to_string(kMostFaces) +
                     " vertices or faces; crop or coarsen the mesh");
  TriangleSurface surface;
  surface.origin = path_;
  surface.format = format;
  surface.first_number = first_number_;
  surface.vertices.resize(count, 3);
  surface.source_vertex.resize(count);
  for (long vertex = 0; vertex < count; ++vertex) {
    surface.vertices.row(vertex) = mm_per_unit_ * vertices_[vertex];
    surface.source_vertex[vertex] = static_cast<int>(vertex);
    if (!surface.vertices.row(vertex).allFinite())
      throw InputError(path_ + ": vertex " + std::to_string(vertex + first_number_) +
                       " has a coordinate that is not finite");
  }
  for (std::size_t triangle = 0; triangle < triangles_.size(); ++triangle) {
    for (const long vertex : triangles_[triangle])
      if (vertex < 0 || vertex >= count)
        throw InputError(path_ + ": face " + std::to_string(source_face_[triangle] + first_number_),
                         "vertex " + std::to_string(vertex + first_number_),
                         std::to_string(first_number_) + ".." + std::to_string(count - 1 + first_number_) +
                             ", the file's vertices");
    const auto [a, b, c] = triangles_[triangle];
    surface.faces.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)});
  }
  surface.source_face = std::move(source_face_);

  std::string polygons;
  for (const auto& [corners, number] : polygons_of_size_)
    polygons += (polygons.empty() ? "" : ", ") + std::to_string(number) +
                (corners == 3   ? " triangles"
                 : corners == 4 ? " quadrangles"
                                : " polygons of " + std::to_string(corners) + " corners");
  if (polygons_of_size_.size() > 4) polygons = std::to_string(num_polygons_) + " polygons";
  surface.notes.push_back(std::to_string(count) + " vertices, " + polygons);
  for (const auto& [what, number] : passed_over_)
    surface.notes.push_back(std::to_string(number) + " " + what + " passed over");
  return surface;
}

}  // namespace rhytid
