// Edge topology of a triangle list, in the order in which the faces first meet each edge.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace rhytid {

/// An undirected edge and the faces that use it.
struct SurfaceEdge {
  int first, second;       ///< vertices, first < second
  std::vector<int> sides;  ///< face · 3 + k: the edge from corner k to corner (k+1)%3 of the face
};

/// All edges, and for each face the index of its edges 0→1, 1→2, 2→0.
struct SurfaceEdges {
  std::vector<SurfaceEdge> edges;
  std::vector<std::array<int, 3>> face_edges;  ///< [num_faces]

  explicit SurfaceEdges(const std::vector<std::array<int, 3>>& faces) : face_edges(faces.size()) {
    std::unordered_map<std::uint64_t, int> known;
    for (int face = 0; face < static_cast<int>(faces.size()); ++face) {
      for (int k = 0; k < 3; ++k) {
        const int a = faces[face][k], b = faces[face][(k + 1) % 3];
        const int first = a < b ? a : b, second = a < b ? b : a;
        const std::uint64_t key =
            (static_cast<std::uint64_t>(first) << 32) | static_cast<std::uint32_t>(second);
        const auto [entry, is_new] = known.try_emplace(key, static_cast<int>(edges.size()));
        if (is_new) edges.push_back({first, second, {}});
        edges[entry->second].sides.push_back(face * 3 + k);
        face_edges[face][k] = entry->second;
      }
    }
  }
};

/// Label of the edge-connected component of each face, numbered by first face; `count` components.
inline std::vector<int> face_components(const SurfaceEdges& topology, int& count) {
  std::vector<int> label(topology.face_edges.size(), -1), stack;
  count = 0;
  for (int seed = 0; seed < static_cast<int>(label.size()); ++seed) {
    if (label[seed] >= 0) continue;
    label[seed] = count;
    stack.assign(1, seed);
    while (!stack.empty()) {
      const int face = stack.back();
      stack.pop_back();
      for (const int edge : topology.face_edges[face]) {
        for (const int side : topology.edges[edge].sides) {
          if (label[side / 3] >= 0) continue;
          label[side / 3] = count;
          stack.push_back(side / 3);
        }
      }
    }
    ++count;
  }
  return label;
}

/// Corners (face · 3 + k) around one vertex grouped into fans joined by edges at that vertex: a manifold
/// vertex has one fan. Fans are in the order of their first face.
std::vector<std::vector<int>> vertex_fans(const std::vector<std::array<int, 3>>& faces,
                                          const std::vector<int>& corners);

/// Corners (face · 3 + k) of each vertex.
std::vector<std::vector<int>> vertex_corners(const std::vector<std::array<int, 3>>& faces, int num_vertices);

}  // namespace rhytid
