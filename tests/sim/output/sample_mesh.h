// A small curved, twisted prism mesh made by hand, so that output is tested without the mesh generator.
#pragma once

#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "sim/mesh/skin_mesh.h"

namespace rhytid::test {

/// A smooth map of (x, y, z) that is far from affine but keeps volumes positive.
inline Vec3 bent(const Vec3& p) {
  return {p.x() + 0.1 * std::sin(p.y() + 2 * p.z()), p.y() + 0.12 * p.x() * p.x() + 0.1 * p.z() * p.x(),
          p.z() + 0.15 * std::cos(1.5 * p.x()) * (1 + 0.3 * p.y())};
}

/// A displacement of a few tenths, for points that are not at rest. [num_nodes · 3]
inline VectorXd sample_displacement(const SkinMesh& mesh) {
  VectorXd u(3 * mesh.num_nodes());
  for (int n = 0; n < mesh.num_nodes(); ++n) {
    const Vec3 x = mesh.rest.row(n);
    u.segment<3>(3 * n) = 0.1 * Vec3(std::sin(x.y()), x.x() * x.y(), std::cos(2 * x.x()));
  }
  return u;
}

/// cells × cells unit squares, two faces each, bent; element layers of the given orders, each 0.4 mm, one
/// material per layer.
inline SkinMesh sample_mesh(int p, const std::vector<int>& layer_orders, int cells = 1) {
  SkinMesh mesh;
  mesh.order = p;
  mesh.num_levels = 1;
  std::vector<double> heights = {0};
  for (size_t k = 0; k < layer_orders.size(); ++k) {
    mesh.element_layers.push_back({mesh.num_levels - 1, layer_orders[k], {{static_cast<int>(k), -1, 1}}});
    mesh.num_levels += layer_orders[k];
    for (int i = 1; i <= layer_orders[k]; ++i) heights.push_back(0.4 * (k + double(i) / layer_orders[k]));
  }
  const TriangleBasis basis(p);
  std::map<std::array<int, 2>, int> column_at;  // lattice of spacing 1/p
  std::vector<Vec2> columns;
  const auto add_face = [&](std::array<int, 2> a, std::array<int, 2> b, std::array<int, 2> c) {
    for (const auto& [i, j] : basis.lattice()) {
      const int k = p - i - j;
      const std::array<int, 2> at = {k * a[0] + i * b[0] + j * c[0], k * a[1] + i * b[1] + j * c[1]};
      const auto [entry, added] = column_at.try_emplace(at, static_cast<int>(columns.size()));
      if (added) columns.push_back(Vec2(at[0], at[1]) / p);
      mesh.face_columns.push_back(entry->second);
    }
    ++mesh.num_faces;
  };
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      // The second face starts at another corner, so that shared edges run in different directions.
      add_face({x, y}, {x + 1, y}, {x, y + 1});
      add_face({x + 1, y + 1}, {x, y + 1}, {x + 1, y});
    }
  }
  mesh.num_columns = static_cast<int>(columns.size());
  mesh.rest.resize(mesh.num_nodes(), 3);
  for (int c = 0; c < mesh.num_columns; ++c) {
    for (int level = 0; level < mesh.num_levels; ++level) {
      mesh.rest.row(mesh.node(c, level)) = bent({columns[c].x(), columns[c].y(), heights[level]}).transpose();
    }
  }
  return mesh;
}

}  // namespace rhytid::test
