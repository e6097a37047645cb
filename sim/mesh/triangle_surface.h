// Triangulated surfaces as they come from files or generators: reading, validating, cropping.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "sim/core/types.h"

namespace rhytid {

/// Surfaces have no more faces and vertices than this, so that what is counted of their elements fits an int.
inline constexpr int kMostFaces = std::numeric_limits<int>::max() / 64;

/// A triangle mesh in mm. Vertex order is the file's (cropping keeps the order of what remains).
struct TriangleSurface {
  MatrixX3 vertices;                      ///< [num_vertices][3], mm
  std::vector<std::array<int, 3>> faces;  ///< counter-clockwise seen from outside
  /// Index in the file, from 0, of each vertex (identity when nothing was left out).
  std::vector<int> source_vertex;
  /// By index in the file, from 0: the vertex of the file that stands for it since coincident ones were
  /// joined, itself where nothing was joined (empty = identity).
  std::vector<int> joined_to;
  std::string origin;            ///< file name or generator, for messages
  std::vector<int> source_face;  ///< polygon in the file of each face, from 0 (empty = identity)

  /// How the file numbers its vertices and polygons: from `first_number` (OBJ 1, PLY and GLB 0), or by
  /// numbers of its own (MSH tags), then these have one entry per vertex or polygon of the file.
  int first_number = 1;
  std::vector<long> vertex_numbers, face_numbers;

  std::string format;              ///< of the file, such as "binary little-endian PLY"; empty for generators
  std::vector<std::string> notes;  ///< what was read, joined and left out; one sentence each

  /// Numbers as messages give them: those of the file.
  long file_vertex(int vertex) const { return vertex_number(source_of_vertex(vertex)); }
  long file_face(int face) const {
    const int source = source_of_face(face);
    return face_numbers.empty() ? source + first_number : face_numbers[source];
  }
  /// The same for an index in the file, from 0.
  long vertex_number(int source) const {
    return vertex_numbers.empty() ? source + first_number : vertex_numbers[source];
  }
  /// Index in the file, from 0.
  int source_of_vertex(int vertex) const { return source_vertex.empty() ? vertex : source_vertex[vertex]; }
  /// Index in the file of the vertex that stands for `source`, an index in the file.
  int standing_for(int source) const {
    const bool is_joined = source >= 0 && source < static_cast<int>(joined_to.size());
    return is_joined ? joined_to[source] : source;
  }
  int source_of_face(int face) const { return source_face.empty() ? face : source_face[face]; }
};

/// Reads a mesh file by its extension: .obj, .ply, .glb or .msh (below). Vertex order kept, polygons fanned
/// into triangles, `mm_per_unit` scales to mm. Throws InputError naming the file and, where there is one, the
/// line.
TriangleSurface read_surface(const std::string& path, double mm_per_unit);

/// Wavefront OBJ: `v` and `f` (v, v/vt, v//vn, v/vt/vn; negative indices count back); all else is passed
/// over.
TriangleSurface read_obj(const std::string& path, double mm_per_unit);

/// Stanford PLY, ascii or binary of either byte order: x, y, z of `vertex`, the list vertex_indices (or
/// vertex_index) of `face`; other properties and elements are passed over.
TriangleSurface read_ply(const std::string& path, double mm_per_unit);

/// glTF 2.0 binary: the triangles (lists, strips, fans) of the default scene under its nodes' transforms,
/// primitives one after the other. A seam of texture or normals doubles vertices in this format: vertices at
/// exactly the same place are joined, faces then name the first of them. Refuses compressed, quantised and
/// sparse data.
TriangleSurface read_glb(const std::string& path, double mm_per_unit);

/// Gmsh MSH 2.2 and 4.1, ascii: triangles and quadrangles of first order; points, lines and solids are passed
/// over, curved elements refused. Messages name node and element tags.
TriangleSurface read_msh(const std::string& path, double mm_per_unit);

/// Vertices that no face uses go, the others keep their order and their numbers of the file; a note says how
/// many.
void drop_unused_vertices(TriangleSurface& surface);

/// Faces name the first of all vertices at exactly the same place (the others are then unused); a note says
/// how many. A face that loses a corner that way stays and is degenerate.
void join_coincident_vertices(TriangleSurface& surface);

/// Throws InputError when two used vertices lie at exactly the same place: an open seam that looks closed.
void refuse_coincident_vertices(const TriangleSurface& surface);

/// Throws InputError with a hint when the whole file's size, taken as mm, is more likely another unit: below
/// 2 (metres) or up to 60 (a head in cm, or a patch in mm: only the user can tell). For files that come
/// without mm_per_unit; above that, validate_surface judges what is used.
void refuse_doubtful_unit(const TriangleSurface& surface);
/// For the message of a crop that fails: the extent of a surface larger than any body, 5 m; else empty.
std::string giant_hint(const TriangleSurface& surface);

enum class GridPattern { union_jack, diagonal_plus, diagonal_minus };

/// A rectangle size_x × size_y mm centred on the origin in the plane z = 0, outward normal +z, cells
/// nx × ny, each split in two by `pattern`. Throws ContractError on empty grids.
TriangleSurface grid_surface(double size_x, double size_y, int nx, int ny, GridPattern pattern);

/// Crops keep the faces whose three vertices are inside, of these the largest edge-connected component,
/// without dangling (single-vertex) contacts; a note says how many faces went that way. They throw InputError
/// when nothing is left.

/// Inside: within geodesic (edge-path) distance `radius` of the vertex nearest to `centre`, which must not be
/// farther away than that itself.
TriangleSurface crop_geodesic_disc(const TriangleSurface& surface, const Vec3& centre, double radius);
/// Inside: within straight distance `radius` of `centre`, mm.
TriangleSurface crop_sphere(const TriangleSurface& surface, const Vec3& centre, double radius);
/// Inside: low ≤ position ≤ high in every component, mm.
TriangleSurface crop_box(const TriangleSurface& surface, const Vec3& low, const Vec3& high);
/// Inside: vertices listed by their index in the file, from 0. `list_origin` names the list in messages.
TriangleSurface crop_vertices(const TriangleSurface& surface, const std::vector<int>& indices,
                              const std::string& list_origin);

/// Loop subdivision: every pass splits each face into four and smooths; the rim becomes the cubic B-spline
/// that has its vertices as control points (weights 1/8, 3/4, 1/8), so that its corners are rounded off. New
/// vertices and faces count as copies of their coarse ones in messages. Throws what validate_surface throws,
/// and InputError where there would be more than kMostFaces faces. Source  C. Loop 1987, with the vertex
/// weights of J. Warren (3/16 for valence 3, else 3/8n).
TriangleSurface subdivide_surface(const TriangleSurface& surface, int passes);

/// Refuses what the simulator cannot extrude: no faces, index out of range, degenerate or duplicate faces,
/// non-manifold edges or vertices, inconsistent orientation, several components, vertices without a face,
/// absurd scale (box diagonal outside 1..1000 mm). Throws InputError with face or vertex numbers (of the
/// file, counted from 1) and a hint.
void validate_surface(const TriangleSurface& surface);

/// Area-weighted unit vertex normals, smoothed `smoothing_passes` times over edges. Shape [num_vertices][3].
MatrixX3 vertex_normals(const TriangleSurface& surface, int smoothing_passes);

}  // namespace rhytid
