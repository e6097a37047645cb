#include "sim/mesh/surface_edges.h"

#include <algorithm>

namespace rhytid {

std::vector<std::vector<int>> vertex_corners(const std::vector<std::array<int, 3>>& faces, int num_vertices) {
  std::vector<std::vector<int>> corners(num_vertices);
  for (int face = 0; face < static_cast<int>(faces.size()); ++face)
    for (int k = 0; k < 3; ++k) corners[faces[face][k]].push_back(face * 3 + k);
  return corners;
}

std::vector<std::vector<int>> vertex_fans(const std::vector<std::array<int, 3>>& faces,
                                          const std::vector<int>& corners) {
  // Two corners at the vertex are in one fan when they share one of their other two vertices.
  const auto shares_edge = [&faces](int left, int right) {
    for (int i = 1; i <= 2; ++i)
      for (int j = 1; j <= 2; ++j)
        if (faces[left / 3][(left % 3 + i) % 3] == faces[right / 3][(right % 3 + j) % 3]) return true;
    return false;
  };
  std::vector<std::vector<int>> fans;
  std::vector<char> taken(corners.size(), 0);
  for (std::size_t seed = 0; seed < corners.size(); ++seed) {
    if (taken[seed]) continue;
    taken[seed] = 1;
    std::vector<int> fan{corners[seed]};
    for (std::size_t at = 0; at < fan.size(); ++at)
      for (std::size_t other = 0; other < corners.size(); ++other)
        if (!taken[other] && shares_edge(fan[at], corners[other])) {
          taken[other] = 1;
          fan.push_back(corners[other]);
        }
    fans.push_back(fan);
  }
  return fans;
}

}  // namespace rhytid
