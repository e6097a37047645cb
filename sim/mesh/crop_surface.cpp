#include <algorithm>
#include <cstdio>
#include <functional>
#include <limits>
#include <queue>

#include "sim/core/error.h"
#include "sim/mesh/surface_edges.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {
namespace {

int nearest_used_vertex(const TriangleSurface& surface, const Vec3& centre) {
  std::vector<char> used(surface.vertices.rows(), 0);
  for (const auto& face : surface.faces)
    for (const int vertex : face) used[vertex] = 1;
  int nearest = -1;
  double least = std::numeric_limits<double>::infinity();
  for (int vertex = 0; vertex < surface.vertices.rows(); ++vertex) {
    const double distance = (surface.vertices.row(vertex).transpose() - centre).squaredNorm();
    if (used[vertex] && distance < least) {
      least = distance;
      nearest = vertex;
    }
  }
  return nearest;
}

// Dijkstra over the edges, stopping beyond `radius`.
std::vector<double> edge_distances(const TriangleSurface& surface, int source, double radius) {
  const int count = static_cast<int>(surface.vertices.rows());
  std::vector<std::vector<int>> neighbours(count);
  for (const SurfaceEdge& edge : SurfaceEdges(surface.faces).edges) {
    neighbours[edge.first].push_back(edge.second);
    neighbours[edge.second].push_back(edge.first);
  }
  std::vector<double> distance(count, std::numeric_limits<double>::infinity());
  std::priority_queue<std::pair<double, int>, std::vector<std::pair<double, int>>, std::greater<>> queue;
  distance[source] = 0;
  queue.push({0., source});
  while (!queue.empty()) {
    const auto [reached, vertex] = queue.top();
    queue.pop();
    if (reached > distance[vertex]) continue;
    for (const int next : neighbours[vertex]) {
      const double length = (surface.vertices.row(next) - surface.vertices.row(vertex)).norm();
      if (reached + length > radius || reached + length >= distance[next]) continue;
      distance[next] = reached + length;
      queue.push({distance[next], next});
    }
  }
  return distance;
}

using Faces = std::vector<std::array<int, 3>>;

// Marks in `kept` the largest edge-connected component of `kept`, dropping the rest; the first wins a tie.
void keep_largest_component(const Faces& faces, std::vector<int>& kept) {
  Faces list;
  for (const int face : kept) list.push_back(faces[face]);
  int count = 0;
  const std::vector<int> label = face_components(SurfaceEdges(list), count);
  std::vector<int> sizes(count, 0);
  for (const int component : label) ++sizes[component];
  const int largest = static_cast<int>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<int> remaining;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (label[i] == largest) remaining.push_back(kept[i]);
  kept = remaining;
}

// At every vertex where `kept` meets itself only in that vertex keeps the largest fan; true when it dropped
// any.
bool drop_dangling_fans(const Faces& faces, int num_vertices, std::vector<int>& kept) {
  Faces list;
  for (const int face : kept) list.push_back(faces[face]);
  std::vector<char> drop(kept.size(), 0);
  bool dropped = false;
  for (const std::vector<int>& corners : vertex_corners(list, num_vertices)) {
    const auto fans = vertex_fans(list, corners);
    if (fans.size() < 2) continue;
    const auto largest = std::max_element(fans.begin(), fans.end(),
                                          [](const auto& l, const auto& r) { return l.size() < r.size(); });
    for (auto fan = fans.begin(); fan != fans.end(); ++fan)
      if (fan != largest)
        for (const int corner : *fan) drop[corner / 3] = 1;
    dropped = true;
  }
  std::vector<int> remaining;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (!drop[i]) remaining.push_back(kept[i]);
  kept = remaining;
  return dropped;
}

TriangleSurface restrict_to(const TriangleSurface& surface, const std::vector<int>& kept) {
  std::vector<int> renumbered(surface.vertices.rows(), -1);
  for (const int face : kept)
    for (const int vertex : surface.faces[face]) renumbered[vertex] = 0;
  TriangleSurface part;
  part.origin = surface.origin;
  for (int vertex = 0; vertex < surface.vertices.rows(); ++vertex) {
    if (renumbered[vertex] < 0) continue;
    renumbered[vertex] = static_cast<int>(part.source_vertex.size());
    part.source_vertex.push_back(surface.file_vertex(vertex) - 1);
  }
  part.vertices.resize(static_cast<int>(part.source_vertex.size()), 3);
  for (int vertex = 0; vertex < surface.vertices.rows(); ++vertex)
    if (renumbered[vertex] >= 0) part.vertices.row(renumbered[vertex]) = surface.vertices.row(vertex);
  for (const int face : kept) {
    const auto [a, b, c] = surface.faces[face];
    part.faces.push_back({renumbered[a], renumbered[b], renumbered[c]});
    part.source_face.push_back(surface.file_face(face) - 1);
  }
  return part;
}

}  // namespace

TriangleSurface crop_geodesic_disc(const TriangleSurface& surface, const Vec3& centre, double radius) {
  require(radius > 0, "crop_geodesic_disc: the radius must be positive");
  const auto nothing_left = [&](const std::string& why) {
    char text[160];
    std::snprintf(text, sizeof text, ": the crop of radius %g mm about (%g, %g, %g) mm keeps no face; ",
                  radius, centre.x(), centre.y(), centre.z());
    throw InputError(surface.origin + text + why);
  };
  const int source = nearest_used_vertex(surface, centre);
  if (source < 0) nothing_left("the surface has none");
  const double away = (surface.vertices.row(source).transpose() - centre).norm();
  if (away > radius) {
    char text[96];
    std::snprintf(text, sizeof text, "the centre is %.4g mm away from the surface; is it in mm?", away);
    nothing_left(text);
  }
  const std::vector<double> distance = edge_distances(surface, source, radius);
  std::vector<int> kept;
  for (int face = 0; face < static_cast<int>(surface.faces.size()); ++face) {
    const auto [a, b, c] = surface.faces[face];
    if (std::max({distance[a], distance[b], distance[c]}) <= radius) kept.push_back(face);
  }
  if (kept.empty())
    nothing_left("its edges at the nearest vertex " + std::to_string(surface.file_vertex(source)) +
                 " are longer than that; raise the radius");
  do {
    keep_largest_component(surface.faces, kept);
  } while (drop_dangling_fans(surface.faces, static_cast<int>(surface.vertices.rows()), kept));
  if (kept.empty())
    nothing_left("what is inside hangs together in single vertices only; change the centre or radius");
  return restrict_to(surface, kept);
}

}  // namespace rhytid
