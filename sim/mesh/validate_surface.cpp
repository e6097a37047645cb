#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <map>

#include "sim/core/error.h"
#include "sim/mesh/surface_edges.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {
namespace {

std::string format_mm(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g mm", value);
  return text;
}

class Validator {
 public:
  explicit Validator(const TriangleSurface& surface) : surface_(surface) {}

  void run() const {
    if (surface_.faces.empty()) fail("no faces");
    check_indices();
    check_scale();
    check_shapes();
    check_duplicates();
    const SurfaceEdges topology(surface_.faces);
    check_edges(topology);
    check_components(topology);
    check_vertices();
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw InputError(surface_.origin + ": " + what); }
  std::string face_name(int face) const { return "face " + std::to_string(surface_.file_face(face)); }
  std::string vertex_name(int vertex) const {
    return "vertex " + std::to_string(surface_.file_vertex(vertex));
  }
  std::string face_with_vertices(int face) const {
    std::string text = face_name(face) + " (vertices";
    for (const int vertex : surface_.faces[face]) text += " " + std::to_string(surface_.file_vertex(vertex));
    return text + ")";
  }

  void check_indices() const {
    const int count = static_cast<int>(surface_.vertices.rows());
    for (int face = 0; face < static_cast<int>(surface_.faces.size()); ++face)
      for (const int vertex : surface_.faces[face])
        if (vertex < 0 || vertex >= count)
          fail(face_name(face) + " names vertex " + std::to_string(vertex + 1) + ", but there are " +
               std::to_string(count));
    for (int vertex = 0; vertex < count; ++vertex)
      if (!surface_.vertices.row(vertex).allFinite())
        fail(vertex_name(vertex) + " has a coordinate that is not finite");
  }

  void check_scale() const {
    const double diagonal =
        (surface_.vertices.colwise().maxCoeff() - surface_.vertices.colwise().minCoeff()).norm();
    if (diagonal >= 1 && diagonal <= 1000) return;
    const std::string found =
        "its box has a diagonal of " + format_mm(diagonal) + ", expected 1 to 1000 mm; ";
    // Mixed-up units of a head, whose box has a diagonal of about 450 mm.
    for (const double factor : {1e-1, 1e-2, 1e-3, 1e1, 1e2, 1e3})
      if (factor * diagonal > 150 && factor * diagonal < 1000) {
        char text[32];
        std::snprintf(text, sizeof text, "%g", factor);
        fail(found + "mm_per_unit times " + text + " would make it " + format_mm(factor * diagonal) +
             ", the size of a head");
      }
    fail(found + "is mm_per_unit right (10 for cm, 1000 for m)?");
  }

  void check_shapes() const {
    for (int face = 0; face < static_cast<int>(surface_.faces.size()); ++face) {
      const auto [i, j, k] = surface_.faces[face];
      const Vec3 a = surface_.vertices.row(i), b = surface_.vertices.row(j), c = surface_.vertices.row(k);
      const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
      const double height = longest > 0 ? (b - a).cross(c - a).norm() / longest : 0;
      if (!(height > 1e-6 * longest))
        fail(face_with_vertices(face) + " is degenerate (height " + format_mm(height) + " over an edge of " +
             format_mm(longest) + "); merge its vertices or remove it");
    }
  }

  void check_duplicates() const {
    std::map<std::array<int, 3>, int> seen;
    for (int face = 0; face < static_cast<int>(surface_.faces.size()); ++face) {
      std::array<int, 3> key = surface_.faces[face];
      std::sort(key.begin(), key.end());
      const auto [entry, is_new] = seen.try_emplace(key, face);
      if (!is_new)
        fail(face_with_vertices(face) + " repeats " + face_name(entry->second) + "; remove one of them");
    }
  }

  void check_edges(const SurfaceEdges& topology) const {
    for (const SurfaceEdge& edge : topology.edges) {
      const std::string name = "the edge between vertices " +
                               std::to_string(surface_.file_vertex(edge.first)) + " and " +
                               std::to_string(surface_.file_vertex(edge.second));
      if (edge.sides.size() > 2) {
        std::string faces;
        for (const int side : edge.sides) faces += " " + std::to_string(surface_.file_face(side / 3));
        fail(name + " is shared by " + std::to_string(edge.sides.size()) + " faces (" + faces.substr(1) +
             "), expected at most 2; cut the surface there or crop a part without it");
      }
      if (edge.sides.size() == 2) {
        const auto starts_at = [this](int side) { return surface_.faces[side / 3][side % 3]; };
        if (starts_at(edge.sides[0]) == starts_at(edge.sides[1]))
          fail(face_name(edge.sides[0] / 3) + " and " + face_name(edge.sides[1] / 3) +
               " run the same way along " + name + "; orient all faces counter-clockwise seen from outside");
      }
    }
  }

  void check_components(const SurfaceEdges& topology) const {
    int count = 0;
    const std::vector<int> label = face_components(topology, count);
    if (count == 1) return;
    const int other = static_cast<int>(std::find(label.begin(), label.end(), 1) - label.begin());
    fail("the surface has " + std::to_string(count) + " separate parts (for example at " + face_name(0) +
         " and " + face_name(other) + "), expected one; keep one part, for example by a crop");
  }

  void check_vertices() const {
    const auto corners = vertex_corners(surface_.faces, static_cast<int>(surface_.vertices.rows()));
    for (int vertex = 0; vertex < static_cast<int>(corners.size()); ++vertex) {
      if (corners[vertex].empty())
        fail(vertex_name(vertex) + " belongs to no face; remove it (a crop drops such vertices)");
      const auto fans = vertex_fans(surface_.faces, corners[vertex]);
      if (fans.size() > 1)
        fail(vertex_name(vertex) + " joins parts that share no edge there (" + face_name(fans[0][0] / 3) +
             " and " + face_name(fans[1][0] / 3) + "); split the vertex or remove one part");
    }
  }

  const TriangleSurface& surface_;
};

}  // namespace

void validate_surface(const TriangleSurface& surface) {
  Validator(surface).run();
}

}  // namespace rhytid
