#include <algorithm>
#include <numeric>
#include <string>
#include <unordered_map>

#include "sim/core/error.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {
namespace {

struct PositionHash {
  std::size_t operator()(const std::array<double, 3>& position) const {
    std::size_t hash = 0;
    for (const double x : position) hash = hash * 1000003 + std::hash<double>()(x);
    return hash;
  }
};

/// For each vertex the first one at the same place (−0 equals 0).
std::vector<int> first_at_place(const TriangleSurface& surface) {
  std::unordered_map<std::array<double, 3>, int, PositionHash> seen;
  std::vector<int> first(surface.vertices.rows());
  for (int vertex = 0; vertex < surface.vertices.rows(); ++vertex) {
    std::array<double, 3> key;
    for (int axis = 0; axis < 3; ++axis) key[axis] = surface.vertices(vertex, axis) + 0.0;
    first[vertex] = seen.try_emplace(key, vertex).first->second;
  }
  return first;
}

}  // namespace

void join_coincident_vertices(TriangleSurface& surface) {
  const std::vector<int> first = first_at_place(surface);
  int joined = 0;
  for (int vertex = 0; vertex < static_cast<int>(first.size()); ++vertex) joined += first[vertex] != vertex;
  if (joined == 0) return;
  // Lists of vertices may name any of those at a place.
  int num_sources = 0;
  for (int vertex = 0; vertex < static_cast<int>(first.size()); ++vertex)
    num_sources = std::max(num_sources, surface.source_of_vertex(vertex) + 1);
  surface.joined_to.resize(num_sources);
  std::iota(surface.joined_to.begin(), surface.joined_to.end(), 0);
  for (int vertex = 0; vertex < static_cast<int>(first.size()); ++vertex)
    surface.joined_to[surface.source_of_vertex(vertex)] = surface.source_of_vertex(first[vertex]);
  for (auto& face : surface.faces)
    for (int& vertex : face) vertex = first[vertex];
  surface.notes.push_back(std::to_string(joined) +
                          " vertices joined with an earlier one at exactly the same place");
  drop_unused_vertices(surface);
  surface.notes.pop_back();  // the note above says it
}

void refuse_coincident_vertices(const TriangleSurface& surface) {
  const std::vector<int> first = first_at_place(surface);
  int doubled = 0, example = -1;
  for (int vertex = 0; vertex < static_cast<int>(first.size()); ++vertex)
    if (first[vertex] != vertex && doubled++ == 0) example = vertex;
  if (doubled == 0) return;
  throw InputError(surface.origin + ": " + std::to_string(doubled) +
                   " vertices lie exactly on another one (vertex " +
                   std::to_string(surface.file_vertex(example)) + " on vertex " +
                   std::to_string(surface.file_vertex(first[example])) +
                   " first), an open seam that looks closed; set /skin/surface/coincident to \"join\", or to "
                   "\"keep\" if the cut is meant");
}

}  // namespace rhytid
