#include <vector>

#include "sim/core/error.h"
#include "sim/mesh/surface_edges.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {
namespace {

/// One pass: vertices first, then one for every edge; four faces for each.
TriangleSurface subdivided_once(const TriangleSurface& coarse) {
  const SurfaceEdges topology(coarse.faces);
  const int vertices = static_cast<int>(coarse.vertices.rows());
  const int edges = static_cast<int>(topology.edges.size());
  const MatrixX3& x = coarse.vertices;
  TriangleSurface fine = coarse;
  fine.vertices.resize(vertices + edges, 3);
  fine.source_vertex.resize(vertices + edges);
  MatrixX3 ring = MatrixX3::Zero(vertices, 3), rim = MatrixX3::Zero(vertices, 3);
  std::vector<int> valence(vertices, 0), on_rim(vertices, 0);
  for (int e = 0; e < edges; ++e) {
    const SurfaceEdge& edge = topology.edges[e];
    const bool is_rim = edge.sides.size() == 1;
    for (const auto& [a, b] : {std::pair(edge.first, edge.second), std::pair(edge.second, edge.first)}) {
      ring.row(a) += x.row(b), ++valence[a];
      if (is_rim) rim.row(a) += x.row(b), ++on_rim[a];
    }
    auto middle = fine.vertices.row(vertices + e);
    middle = 0.5 * (x.row(edge.first) + x.row(edge.second));
    // Interior: ⅜ of each end and ⅛ of each opposite corner.
    if (!is_rim) {
      middle *= 0.75;
      for (const int side : edge.sides) middle += 0.125 * x.row(coarse.faces[side / 3][(side % 3 + 2) % 3]);
    }
    fine.source_vertex[vertices + e] = coarse.source_of_vertex(edge.first);
  }
  for (int v = 0; v < vertices; ++v) {
    fine.source_vertex[v] = coarse.source_of_vertex(v);
    const double n = valence[v], weight = n == 3 ? 3. / 16 : 3 / (8 * n);
    if (on_rim[v] > 0) {
      fine.vertices.row(v) = 0.75 * x.row(v) + 0.25 / on_rim[v] * rim.row(v);
    } else {
      fine.vertices.row(v) = (1 - n * weight) * x.row(v) + weight * ring.row(v);
    }
  }
  fine.faces.clear();
  fine.source_face.clear();
  for (int f = 0; f < static_cast<int>(coarse.faces.size()); ++f) {
    const auto& corner = coarse.faces[f];
    const int m0 = vertices + topology.face_edges[f][0], m1 = vertices + topology.face_edges[f][1],
              m2 = vertices + topology.face_edges[f][2];
    for (const std::array<int, 3>& face : {std::array{corner[0], m0, m2}, std::array{m0, corner[1], m1},
                                           std::array{m2, m1, corner[2]}, std::array{m0, m1, m2}}) {
      fine.faces.push_back(face);
      fine.source_face.push_back(coarse.source_of_face(f));
    }
  }
  return fine;
}

}  // namespace

TriangleSurface subdivide_surface(const TriangleSurface& surface, int passes) {
  require(passes >= 0 && passes <= 6, "subdivide_surface: 0 to 6 passes");
  if (passes == 0) return surface;
  const long most = static_cast<long>(surface.faces.size()) << (2 * passes);
  if (most > kMostFaces)
    throw InputError(surface.origin,
                     std::to_string(surface.faces.size()) + " faces to subdivide " + std::to_string(passes) +
                         " times into " + std::to_string(most),
                     "at most " + std::to_string(kMostFaces) + " in the end");
  validate_surface(surface);
  TriangleSurface fine = surface;
  for (int pass = 0; pass < passes; ++pass) fine = subdivided_once(fine);
  fine.notes.push_back("subdivided " + std::to_string(passes) + (passes == 1 ? " time, " : " times, ") +
                       std::to_string(surface.faces.size()) + " faces to " +
                       std::to_string(fine.faces.size()));
  return fine;
}

}  // namespace rhytid
