// Triangulated surfaces as they come from files or generators: reading, validating, cropping.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "sim/core/types.h"

namespace rhytid {

/// A triangle mesh in mm. Vertex order is the file's (cropping keeps the order of what remains).
struct TriangleSurface {
  MatrixX3 vertices;                      ///< [num_vertices][3], mm
  std::vector<std::array<int, 3>> faces;  ///< counter-clockwise seen from outside
  std::vector<int> source_vertex;  ///< index in the file of each vertex (identity when nothing was cropped)
  std::string origin;              ///< file name or generator, for messages
  std::vector<int> source_face;    ///< polygon in the file of each face (empty = identity)

  /// Numbers as messages give them, counted from 1 like the indices of an OBJ file.
  int file_vertex(int vertex) const { return (source_vertex.empty() ? vertex : source_vertex[vertex]) + 1; }
  int file_face(int face) const { return (source_face.empty() ? face : source_face[face]) + 1; }
};

/// Reads a Wavefront OBJ; polygons are fanned into triangles; vertex order kept. `mm_per_unit` scales to mm.
/// Reads `v` and `f` (v, v/vt, v//vn, v/vt/vn; negative indices count back) and passes over everything else.
/// Throws InputError naming the file and the line.
TriangleSurface read_obj(const std::string& path, double mm_per_unit);

enum class GridPattern { union_jack, diagonal_plus, diagonal_minus };

/// A rectangle size_x × size_y mm centred on the origin in the plane z = 0, outward normal +z, cells
/// nx × ny, each split in two by `pattern`. Throws ContractError on empty grids.
TriangleSurface grid_surface(double size_x, double size_y, int nx, int ny, GridPattern pattern);

/// Keeps the faces whose three vertices lie within geodesic (edge-path) distance `radius` of the vertex
/// nearest to `centre`, then the largest edge-connected component, without dangling (single-vertex) contacts.
/// Throws InputError when nothing is left or `centre` is farther than `radius` from the nearest vertex.
TriangleSurface crop_geodesic_disc(const TriangleSurface& surface, const Vec3& centre, double radius);

/// Refuses what the simulator cannot extrude: no faces, index out of range, degenerate or duplicate faces,
/// non-manifold edges or vertices, inconsistent orientation, several components, vertices without a face,
/// absurd scale (box diagonal outside 1..1000 mm). Throws InputError with face or vertex numbers (of the
/// file, counted from 1) and a hint.
void validate_surface(const TriangleSurface& surface);

/// Area-weighted unit vertex normals, smoothed `smoothing_passes` times over edges. Shape [num_vertices][3].
MatrixX3 vertex_normals(const TriangleSurface& surface, int smoothing_passes);

}  // namespace rhytid
