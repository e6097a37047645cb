// Vertices and polygons as a mesh reader meets them, turned into a TriangleSurface. Internal to sim/mesh.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "sim/mesh/triangle_surface.h"

namespace rhytid {

/// Throws InputError unless there is a file at `path`.
void require_mesh_file(const std::string& path);

/// The whole file as bytes. Throws InputError when it cannot be read.
std::string read_mesh_bytes(const std::string& path);

class SurfaceBuilder {
 public:
  /// `first_number` as in TriangleSurface. Throws ContractError unless `mm_per_unit` is positive.
  SurfaceBuilder(std::string path, double mm_per_unit, int first_number);

  /// A vertex in the file's unit.
  void add_vertex(const Vec3& position) { vertices_.push_back(position); }
  /// A polygon of at least three vertex indices from 0, fanned from its first corner. Vertices may follow
  /// later.
  void add_polygon(const std::vector<long>& corners);
  /// Something of the file that is of no use here; a note counts it.
  void pass_over(const std::string& what) { ++passed_over_[what]; }

  long num_vertices() const { return static_cast<long>(vertices_.size()); }
  int num_polygons() const { return num_polygons_; }
  const std::string& path() const { return path_; }
  /// The result; numbers of the file's own and notes may be added to it. Throws InputError when there are no
  /// vertices or faces, when a face names a vertex that does not exist, and when a coordinate is not finite.
  TriangleSurface finish(const std::string& format);

 private:
  std::string path_;
  double mm_per_unit_;
  int first_number_, num_polygons_ = 0;
  std::vector<Vec3> vertices_;
  std::vector<std::array<long, 3>> triangles_;
  std::vector<int> source_face_;
  std::map<std::string, long> passed_over_;
  std::map<std::size_t, long> polygons_of_size_;
};

}  // namespace rhytid
