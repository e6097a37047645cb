#include <string>

#include "sim/core/error.h"
#include "sim/mesh/surface_edges.h"
#include "sim/mesh/triangle_surface.h"

#include <Eigen/Geometry>

namespace rhytid {
namespace {

void normalise_rows(MatrixX3& normals, const std::vector<char>& used, const TriangleSurface& surface) {
  for (int vertex = 0; vertex < normals.rows(); ++vertex) {
    if (!used[vertex]) continue;
    const double length = normals.row(vertex).norm();
    if (!(length > 0))
      throw InputError(surface.origin + ": vertex " + std::to_string(surface.file_vertex(vertex)) +
                       ": the normals of its faces cancel; remove the fold or the doubled faces there");
    normals.row(vertex) /= length;
  }
}

}  // namespace

MatrixX3 vertex_normals(const TriangleSurface& surface, int smoothing_passes) {
  require(smoothing_passes >= 0, "vertex_normals: the number of smoothing passes must not be negative");
  MatrixX3 normals = MatrixX3::Zero(surface.vertices.rows(), 3);
  std::vector<char> used(surface.vertices.rows(), 0);
  for (const auto& face : surface.faces) {
    const Vec3 a = surface.vertices.row(face[0]), b = surface.vertices.row(face[1]),
               c = surface.vertices.row(face[2]);
    const Vec3 area_vector = (b - a).cross(c - a) / 2;
    for (const int vertex : face) {
      normals.row(vertex) += area_vector;
      used[vertex] = 1;
    }
  }
  normalise_rows(normals, used, surface);
  if (smoothing_passes == 0) return normals;
  const SurfaceEdges topology(surface.faces);
  for (int pass = 0; pass < smoothing_passes; ++pass) {
    MatrixX3 sum = normals;
    for (const SurfaceEdge& edge : topology.edges) {
      sum.row(edge.first) += normals.row(edge.second);
      sum.row(edge.second) += normals.row(edge.first);
    }
    normalise_rows(sum, used, surface);
    normals = sum;
  }
  return normals;
}

}  // namespace rhytid
