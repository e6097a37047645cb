#include "sim/mesh/skin_mesh.h"

#include <random>

#include "sim/core/error.h"
#include "sim/mesh/columns.h"

namespace rhytid {
namespace {

std::vector<int> trace_nodes(const SkinMesh& mesh, int face, int level) {
  require(face >= 0 && face < mesh.num_faces, "SkinMesh: face out of range");
  std::vector<int> nodes;
  for (int j = 0; j < mesh.nodes_per_face(); ++j)
    nodes.push_back(mesh.node(mesh.face_columns[face * mesh.nodes_per_face() + j], level));
  return nodes;
}

}  // namespace

std::vector<int> SkinMesh::element_nodes(int layer, int face) const {
  require(layer >= 0 && layer < static_cast<int>(element_layers.size()),
          "SkinMesh: element layer out of range");
  require(face >= 0 && face < num_faces, "SkinMesh: face out of range");
  const ElementLayer& sheet = element_layers[layer];
  std::vector<int> nodes;
  for (int j = 0; j < nodes_per_face(); ++j)
    for (int k = 0; k <= sheet.order; ++k)
      nodes.push_back(node(face_columns[face * nodes_per_face() + j], sheet.first_level + k));
  return nodes;
}

std::vector<int> SkinMesh::inner_nodes(int face) const {
  return trace_nodes(*this, face, 0);
}
std::vector<int> SkinMesh::outer_nodes(int face) const {
  return trace_nodes(*this, face, num_levels - 1);
}

void add_imperfection(SkinMesh& mesh, double amplitude, int seed) {
  require(amplitude >= 0, "add_imperfection: the amplitude must not be negative");
  std::mt19937 random(static_cast<unsigned>(seed));
  if (mesh.imperfection.size() == 0) mesh.imperfection = VectorXd::Zero(mesh.num_columns);
  for (int column = 0; column < mesh.num_columns; ++column) {
    // Distributions of the standard library differ between its makers.
    const double uniform = 2 * (static_cast<double>(random()) / 4294967295.) - 1;
    for (int level = 0; level < mesh.num_levels; ++level)
      mesh.rest.row(mesh.node(column, level)) += amplitude * uniform * mesh.column_normals.row(column);
    mesh.imperfection[column] += amplitude * uniform;
  }
}

VectorXd interpolate_vertices(const SkinMesh& mesh, const VectorXd& at_vertices) {
  return interpolate_vertices(mesh.surface, mesh.face_columns, TriangleBasis(mesh.order), at_vertices);
}

}  // namespace rhytid
