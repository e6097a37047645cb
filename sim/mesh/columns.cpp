#include "sim/mesh/columns.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace rhytid {
namespace {

int number_columns(const TriangleSurface& surface, const SurfaceEdges& topology, const TriangleBasis& basis,
                   std::vector<int>& face_columns) {
  const int p = basis.order(), on_edge = p - 1, inside = basis.num_nodes() - 3 * p;
  const int first_edge = static_cast<int>(surface.vertices.rows());
  const int first_inside = first_edge + on_edge * static_cast<int>(topology.edges.size());
  for (int face = 0; face < static_cast<int>(surface.faces.size()); ++face) {
    for (const int vertex : surface.faces[face]) face_columns.push_back(vertex);
    for (int k = 0; k < 3; ++k) {
      const int edge = topology.face_edges[face][k];
      const bool along = surface.faces[face][k] == topology.edges[edge].first;
      for (int m = 0; m < on_edge; ++m)
        face_columns.push_back(first_edge + on_edge * edge + (along ? m : on_edge - 1 - m));
    }
    for (int m = 0; m < inside; ++m) face_columns.push_back(first_inside + inside * face + m);
  }
  return first_inside + inside * static_cast<int>(surface.faces.size());
}

void place_columns(const TriangleSurface& surface, const TriangleBasis& basis,
                   const MatrixX3& vertex_directions, double bend_radius, Columns& columns) {
  const double p = basis.order();
  for (int face = 0; face < static_cast<int>(surface.faces.size()); ++face) {
    const auto corners = surface.faces[face];
    for (int node = 0; node < basis.num_nodes(); ++node) {
      const auto [i, j] = basis.lattice()[node];
      const double weights[3] = {(p - i - j) / p, i / p, j / p};
      Vec3 position = Vec3::Zero(), direction = Vec3::Zero();
      for (int k = 0; k < 3; ++k) {
        position += weights[k] * surface.vertices.row(corners[k]).transpose();
        direction += weights[k] * vertex_directions.row(corners[k]).transpose();
      }
      if (bend_radius > 0) {
        position = bend(position, bend_radius);
        direction = Vec3(position.x(), 0, position.z());
      }
      const int column = columns.face_columns[face * basis.num_nodes() + node];
      columns.positions.row(column) = position;
      columns.normals.row(column) = direction.normalized();
    }
  }
}

// The outward conormal t × n at every node of every boundary edge, t along the edge with the face on its
// left; at a vertex the mean over its two boundary edges, and the angle between them.
void find_rim(const TriangleSurface& surface, const SurfaceEdges& topology, const TriangleBasis& basis,
              Columns& columns) {
  const int p = basis.order(), per_face = basis.num_nodes();
  const LineBasis line(p);
  MatrixX3 sum = MatrixX3::Zero(columns.positions.rows(), 3);
  std::vector<std::vector<Vec3>> conormals(static_cast<std::size_t>(columns.positions.rows()));
  for (const SurfaceEdge& edge : topology.edges) {
    if (edge.sides.size() != 1) continue;
    const int face = edge.sides[0] / 3, side = edge.sides[0] % 3;
    std::vector<int> along{surface.faces[face][side]};
    for (int m = 0; m < p - 1; ++m)
      along.push_back(columns.face_columns[face * per_face + 3 + side * (p - 1) + m]);
    along.push_back(surface.faces[face][(side + 1) % 3]);
    for (int at = 0; at <= p; ++at) {
      double slopes[5];
      line.evaluate(line.nodes()[at], nullptr, slopes);
      Vec3 tangent = Vec3::Zero();
      for (int m = 0; m <= p; ++m) tangent += slopes[m] * columns.positions.row(along[m]).transpose();
      const Vec3 normal = columns.normals.row(along[at]);
      const Vec3 conormal = tangent.cross(normal).normalized();
      // Two antiparallel conormals (the tip of a slit) leave nothing: then the first edge decides.
      if ((sum.row(along[at]).transpose() + conormal).norm() > 1e-6) sum.row(along[at]) += conormal;
      conormals[along[at]].push_back(conormal);
    }
  }
  for (int column = 0; column < static_cast<int>(conormals.size()); ++column) {
    const std::vector<Vec3>& here = conormals[column];
    if (here.empty()) continue;
    columns.rim.push_back(column);
    double turn = 0;
    for (std::size_t i = 1; i < here.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        turn = std::max(turn, std::atan2(here[i].cross(here[j]).norm(), here[i].dot(here[j])));
    columns.rim_turns.push_back(turn);
  }
  columns.rim_directions.resize(static_cast<int>(columns.rim.size()), 3);
  for (std::size_t i = 0; i < columns.rim.size(); ++i)
    columns.rim_directions.row(i) = sum.row(columns.rim[i]).normalized();
}

}  // namespace

VectorXd interpolate_vertices(const TriangleSurface& surface, const std::vector<int>& face_columns,
                              const TriangleBasis& basis, const VectorXd& at_vertices) {
  VectorXd values = VectorXd::Zero(*std::max_element(face_columns.begin(), face_columns.end()) + 1);
  const double p = basis.order();
  for (std::size_t face = 0; face < surface.faces.size(); ++face) {
    const auto& corners = surface.faces[face];
    for (int node = 0; node < basis.num_nodes(); ++node) {
      const auto [i, j] = basis.lattice()[node];
      values[face_columns[face * basis.num_nodes() + node]] =
          ((p - i - j) * at_vertices[corners[0]] + i * at_vertices[corners[1]] +
           j * at_vertices[corners[2]]) /
          p;
    }
  }
  return values;
}

Vec3 bend(const Vec3& flat, double radius) {
  const double angle = flat.x() / radius;
  return {radius * std::sin(angle), flat.y(), radius * std::cos(angle)};
}

Columns make_columns(const TriangleSurface& surface, const SurfaceEdges& topology, const TriangleBasis& basis,
                     const MatrixX3& vertex_directions, double bend_radius) {
  Columns columns;
  const int count = number_columns(surface, topology, basis, columns.face_columns);
  columns.positions.resize(count, 3);
  columns.normals.resize(count, 3);
  place_columns(surface, basis, vertex_directions, bend_radius, columns);
  find_rim(surface, topology, basis, columns);
  return columns;
}

}  // namespace rhytid
