// The prism mesh of a skin patch: a triangulated surface extruded along smoothed normals into layers.
//
// Nodes are columns × levels: column = in-plane Lagrange node of order p (shared between faces), level =
// through-thickness node, level 0 = inner surface, last = outer surface. node = column · num_levels + level.
// Element layers stack from inner to outer; neighbouring element layers share a level. One element layer
// holds one material layer (stacked) or all of them (composite, split into slabs along w).
#pragma once

#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/element/basis.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {

/// The part of an element layer's natural thickness [−1, 1] that one material layer fills.
struct MaterialSlab {
  int material;           ///< index of the material layer, 0 = innermost
  double w_begin, w_end;  ///< natural thickness range inside the element
};

/// One sheet of elements: every face carries one element of thickness order q.
struct ElementLayer {
  int first_level;                  ///< level of its inner face
  int order;                        ///< q
  std::vector<MaterialSlab> slabs;  ///< inner to outer
};

struct SkinMesh {
  int order = 1;                             ///< p, in-plane Lagrange order
  int num_columns = 0;                       ///< in-plane nodes
  int num_levels = 0;                        ///< through-thickness nodes
  int num_faces = 0;                         ///< triangles = elements per element layer
  std::vector<int> face_columns;             ///< [num_faces][triangle nodes], TriangleBasis node order
  std::vector<ElementLayer> element_layers;  ///< inner to outer
  MatrixX3 rest;                             ///< [num_columns · num_levels][3] rest positions X, mm
  MatrixX3 column_normals;                   ///< [num_columns][3] unit extrusion direction
  std::vector<int> rim_columns;              ///< columns on the boundary of the patch
  MatrixX3 rim_directions;                   ///< [rim_columns][3] unit in-plane outward conormal there
  std::vector<double> rim_turns;    ///< [rim_columns] how far the rim turns there, rad; 0 inside an edge
  std::vector<int> vertex_columns;  ///< column of each vertex of the input surface
  TriangleSurface surface;          ///< the input surface (vertices on the cylinder when bent)
  VectorXd imperfection;            ///< [num_columns] mm along the normals, in `rest` already; empty = none

  int num_nodes() const { return num_columns * num_levels; }
  int node(int column, int level) const { return column * num_levels + level; }
  int nodes_per_face() const { return (order + 1) * (order + 2) / 2; }
  /// Element index: face-major inside an element layer, layer k holds [k·num_faces, (k+1)·num_faces).
  int num_elements() const { return num_faces * static_cast<int>(element_layers.size()); }
  /// Nodes of an element, [triangle node j][thickness node k] with k fastest: index j·(q+1)+k.
  std::vector<int> element_nodes(int layer, int face) const;
  /// Nodes of a face's trace on the inner (level 0) or outer (last level) surface, TriangleBasis node order.
  std::vector<int> inner_nodes(int face) const;
  std::vector<int> outer_nodes(int face) const;
};

/// How to extrude: thickness per material layer from inner to outer, elements and thickness order per layer.
struct ExtrusionLayer {
  double thickness;      ///< mm, > 0
  int elements = 1;      ///< element layers in this material layer (stacked only)
  int order = 2;         ///< q of those elements (stacked only)
  VectorXd by_vertex{};  ///< mm, [vertices of the surface], in place of `thickness`; empty = constant
};
struct ExtrusionOptions {
  int order = 3;                       ///< p
  std::vector<ExtrusionLayer> layers;  ///< inner to outer
  bool composite = false;              ///< one element through all layers
  int composite_order = 3;             ///< q of the composite element
  bool surface_is_outer = true;        ///< the given surface is the outer one (else the inner one)
  int normal_smoothing = 2;            ///< passes over the vertex normals
  /// Radius (mm) of a cylinder about the y axis onto which a flat grid is bent (0 = none): gives truly curved
  /// elements, every high-order node lies on the cylinder; outer normal points away from the axis.
  double bend_radius = 0;
};

/// Builds the prism mesh. Columns: vertices of the surface first, then edge nodes, then face-interior nodes.
/// Positions at high-order columns are interpolated linearly on the face (on the cylinder when bent), normals
/// are interpolated and normalised; levels are spread evenly in each element layer. Material layers of a
/// composite fill slabs of w in proportion to their thickness.
/// Validates the surface first; throws InputError when the extrusion folds (J ≤ 0 at a node of some element),
/// naming face numbers, the depth at which the first fold appears, and a hint.
/// A thickness per vertex is linear on the faces; in a composite the layers have to keep their ratio, since
/// its slabs are the same everywhere (InputError naming the vertex).
SkinMesh extrude(const TriangleSurface& surface, const ExtrusionOptions& options);

/// Moves every column of nodes along its normal by a random length, uniform in ±amplitude (mm). The same seed
/// gives the same numbers on every machine.
void add_imperfection(SkinMesh& mesh, double amplitude, int seed);

/// Values at all columns from values at the vertices of mesh.surface, linear on every face.
VectorXd interpolate_vertices(const SkinMesh& mesh, const VectorXd& at_vertices);

}  // namespace rhytid
