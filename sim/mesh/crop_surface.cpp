#include <algorithm>
#include <cstdio>
#include <functional>
#include <limits>
#include <queue>
#include <unordered_map>

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

/// The faces `inside` that hang together; `what` names the crop for messages.
TriangleSurface keep_faces(const TriangleSurface& surface, std::vector<int> inside, const std::string& what) {
  const std::size_t all = inside.size();
  if (all == 0) throw InputError(surface.origin + ": " + what + " keeps no face");
  do {
    keep_largest_component(surface.faces, inside);
  } while (drop_dangling_fans(surface.faces, static_cast<int>(surface.vertices.rows()), inside));
  if (inside.empty())
    throw InputError(surface.origin + ": " + what +
                     " keeps no face; what is inside hangs together in single vertices only");
  TriangleSurface part = surface;
  part.faces.clear();
  part.source_face.clear();
  for (const int face : inside) {
    part.faces.push_back(surface.faces[face]);
    part.source_face.push_back(surface.source_of_face(face));
  }
  drop_unused_vertices(part);
  part.notes = surface.notes;  // vertices outside are no news
  std::string note = what + " keeps " + std::to_string(inside.size()) + " of " +
                     std::to_string(surface.faces.size()) + " triangles and " +
                     std::to_string(part.vertices.rows()) + " vertices";
  if (all > inside.size())
    note += ", without " + std::to_string(all - inside.size()) +
            " triangles that hang on the largest part by " + "single vertices or not at all";
  part.notes.push_back(note);
  return part;
}

template <class Inside>
std::vector<int> faces_with(const TriangleSurface& surface, const Inside& inside) {
  std::vector<int> kept;
  for (int face = 0; face < static_cast<int>(surface.faces.size()); ++face) {
    const auto [a, b, c] = surface.faces[face];
    if (inside(a) && inside(b) && inside(c)) kept.push_back(face);
  }
  return kept;
}

std::string point_text(const Vec3& p) {
  char text[96];
  std::snprintf(text, sizeof text, "(%g, %g, %g)", p.x(), p.y(), p.z());
  return text;
}

std::string ball_text(const Vec3& centre, double radius) {
  char text[32];
  std::snprintf(text, sizeof text, "%g mm", radius);
  return std::string("the crop of radius ") + text + " about " + point_text(centre) + " mm";
}

}  // namespace

void drop_unused_vertices(TriangleSurface& surface) {
  const int count = static_cast<int>(surface.vertices.rows());
  std::vector<int> renumbered(count, -1), sources;
  for (const auto& face : surface.faces)
    for (const int vertex : face) renumbered[vertex] = 0;
  for (int vertex = 0; vertex < count; ++vertex) {
    if (renumbered[vertex] < 0) continue;
    renumbered[vertex] = static_cast<int>(sources.size());
    surface.vertices.row(renumbered[vertex]) = surface.vertices.row(vertex).eval();  // never moves up
    sources.push_back(surface.source_of_vertex(vertex));
  }
  const int used = static_cast<int>(sources.size());
  surface.vertices.conservativeResize(used, 3);
  surface.source_vertex = std::move(sources);
  for (auto& face : surface.faces)
    for (int& vertex : face) vertex = renumbered[vertex];
  if (used < count) surface.notes.push_back(std::to_string(count - used) + " vertices that no face uses");
}

TriangleSurface crop_sphere(const TriangleSurface& surface, const Vec3& centre, double radius) {
  require(radius > 0, "crop_sphere: the radius must be positive");
  return keep_faces(surface,
                    faces_with(surface,
                               [&](int vertex) {
                                 return (surface.vertices.row(vertex).transpose() - centre).norm() <= radius;
                               }),
                    ball_text(centre, radius));
}

TriangleSurface crop_box(const TriangleSurface& surface, const Vec3& low, const Vec3& high) {
  return keep_faces(surface,
                    faces_with(surface,
                               [&](int vertex) {
                                 const Vec3 x = surface.vertices.row(vertex);
                                 return (x.array() >= low.array()).all() && (x.array() <= high.array()).all();
                               }),
                    "the crop to the box " + point_text(low) + " to " + point_text(high) + " mm");
}

TriangleSurface crop_vertices(const TriangleSurface& surface, const std::vector<int>& indices,
                              const std::string& list_origin) {
  const int count = static_cast<int>(surface.vertices.rows());
  std::unordered_map<int, int> index_of;
  int last = static_cast<int>(surface.joined_to.size()) - 1;
  for (int vertex = 0; vertex < count; ++vertex) {
    index_of[surface.source_of_vertex(vertex)] = vertex;
    last = std::max(last, surface.source_of_vertex(vertex));
  }
  std::vector<char> listed(count, 0);
  for (const int index : indices) {
    if (index < 0 || index > last)
      throw InputError(list_origin, "vertex " + std::to_string(index),
                       "vertices of " + surface.origin + " counted from 0, up to " + std::to_string(last));
    const auto found = index_of.find(surface.standing_for(index));
    if (found != index_of.end()) listed[found->second] = 1;  // else used by no face
  }
  return keep_faces(surface, faces_with(surface, [&](int vertex) { return listed[vertex] != 0; }),
                    "the crop to " + std::to_string(indices.size()) + " listed vertices");
}

TriangleSurface crop_geodesic_disc(const TriangleSurface& surface, const Vec3& centre, double radius) {
  require(radius > 0, "crop_geodesic_disc: the radius must be positive");
  const std::string what = ball_text(centre, radius);
  const auto nothing_left = [&](const std::string& why) {
    throw InputError(surface.origin + ": " + what + " keeps no face; " + why);
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
  const std::vector<int> kept = faces_with(surface, [&](int vertex) { return distance[vertex] <= radius; });
  if (kept.empty())
    nothing_left("its edges at the nearest vertex " + std::to_string(surface.file_vertex(source)) +
                 " are longer than that; raise the radius");
  return keep_faces(surface, kept, what);
}

}  // namespace rhytid
