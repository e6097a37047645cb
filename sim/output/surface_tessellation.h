// The outer or inner surface of a skin as small flat triangles that follow the curved high-order faces.
// Used for pictures, rendered footage, ray casts and the .vtp/.obj files.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/mesh/skin_mesh.h"

namespace rhytid {

enum class SurfaceSide { inner, outer };

/// Every face of one side cut into n × n sub-triangles. Each face has its own (n+1)(n+2)/2 vertices, so a
/// vertex knows one face and one (u, v); `welded` says which of them are the same point of the surface.
/// Triangles are counter-clockwise seen from the outer side (along +w), for both sides.
class SubdividedSurface {
 public:
  struct Vertex {
    int face;     ///< face of the SkinMesh
    double u, v;  ///< natural coordinates in it
  };

  /// Copies what it needs from `mesh`. Throws ContractError unless 1 ≤ subdivision ≤ 64.
  SubdividedSurface(const SkinMesh& mesh, SurfaceSide side, int subdivision);

  int num_vertices() const { return static_cast<int>(vertices_.size()); }
  int num_nodes() const { return num_nodes_; }  ///< nodes of the whole SkinMesh
  const std::vector<Vertex>& vertices() const { return vertices_; }
  /// [num_faces · n²]: sub-triangles of face f are [f·n², (f+1)·n²).
  const std::vector<std::array<int, 3>>& triangles() const { return triangles_; }
  int face_of_triangle(int triangle) const { return triangle / (subdivision_ * subdivision_); }
  /// Representative (smallest equal) vertex of each vertex: shared corners and edges have one representative.
  const std::vector<int>& welded() const { return welded_; }
  /// Interpolation row of a vertex: value = Σ weight · node value.
  struct Row {
    const int* nodes;       ///< [nodes_per_face] nodes of the SkinMesh on this side
    const double* weights;  ///< [nodes_per_face] basis values there
    int size;
  };
  Row row(int vertex) const;

  /// Deformed positions, mm, [num_vertices][3]; `displacement` is [num_nodes · 3] in mm, empty = rest.
  MatrixX3 positions(const VectorXd& displacement) const;
  /// Unit normals toward the outer side from the exact tangents ∂x/∂u × ∂x/∂v of each vertex's face; where
  /// the surface is only C⁰ (across faces) they differ between welded vertices. [num_vertices][3]
  MatrixX3 normals(const VectorXd& displacement) const;
  /// The same normals, averaged over welded vertices: what a smooth picture wants. [num_vertices][3]
  MatrixX3 smooth_normals(const VectorXd& displacement) const;
  /// A scalar given per node (size num_nodes) or per column (size num_columns) at the vertices.
  /// [num_vertices]
  VectorXd interpolate(const VectorXd& values) const;
  /// Height of the skin's motion along the rest normals, mm: (x − X)·N. [num_vertices]
  VectorXd normal_displacement(const VectorXd& displacement) const;

 private:
  enum class Derivative { none, u, v };
  MatrixX3 apply(const VectorXd& displacement, Derivative derivative) const;

  int subdivision_, nodes_per_face_, num_nodes_, num_columns_, num_levels_, points_per_face_;
  std::vector<Vertex> vertices_;
  std::vector<std::array<int, 3>> triangles_;
  std::vector<int> welded_, face_nodes_;      // face_nodes_ [num_faces][nodes_per_face]
  std::vector<double> values_, d_du_, d_dv_;  // [points_per_face][nodes_per_face]
  MatrixX3 rest_;                             // [num_nodes][3]
};

}  // namespace rhytid
