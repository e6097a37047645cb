// In-plane nodes of a patch: numbering shared across edges, positions, extrusion directions and the rim.
#pragma once

#include <vector>

#include "sim/core/types.h"
#include "sim/element/basis.h"
#include "sim/mesh/surface_edges.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {

/// Columns of a surface: vertices first, then p−1 nodes of each edge (from its lower to its higher vertex),
/// then the interior nodes of each face.
struct Columns {
  std::vector<int> face_columns;  ///< [num_faces][triangle nodes], TriangleBasis node order
  MatrixX3 positions;             ///< [num_columns][3] on the given surface, mm
  MatrixX3 normals;               ///< [num_columns][3] unit, outward
  std::vector<int> rim;           ///< columns on boundary edges, ascending
  MatrixX3 rim_directions;        ///< [rim][3] unit, tangential, outward from the patch
  std::vector<double> rim_turns;  ///< [rim] largest angle between the conormals of edges that meet there, rad
};

/// `vertex_directions` [num_vertices][3] are unit normals at the vertices. A positive `bend_radius` rolls the
/// plane z = 0 onto the cylinder about the y axis: (x, y, 0) ↦ (R sin x/R, y, R cos x/R), normals radial.
Columns make_columns(const TriangleSurface& surface, const SurfaceEdges& topology, const TriangleBasis& basis,
                     const MatrixX3& vertex_directions, double bend_radius);

/// Values at all columns from values at the vertices, linear on every face.
VectorXd interpolate_vertices(const TriangleSurface& surface, const std::vector<int>& face_columns,
                              const TriangleBasis& basis, const VectorXd& at_vertices);

/// The point of the cylinder about the y axis that (x, y, 0) is rolled onto.
Vec3 bend(const Vec3& flat, double radius);

}  // namespace rhytid
