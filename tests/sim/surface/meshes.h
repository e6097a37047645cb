// Small surfaces for the heat map tests.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::testing {

struct Mesh {
  MatrixX3 nodes;
  std::vector<std::array<int, 3>> triangles;
};

/// [0, size]² in z = 0, n × n cells cut along one diagonal.
inline Mesh square(int n, double size) {
  Mesh mesh;
  mesh.nodes.resize((n + 1) * (n + 1), 3);
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) mesh.nodes.row(j * (n + 1) + i) << size * i / n, size * j / n, 0.0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  return mesh;
}

/// Sphere of radius 1 by n rings and 2 n sectors: slivers at the poles.
inline Mesh latitude_sphere(int n) {
  Mesh mesh;
  const int sectors = 2 * n, inner = (n - 1) * sectors;
  mesh.nodes.resize(inner + 2, 3);
  for (int r = 1; r < n; ++r)
    for (int s = 0; s < sectors; ++s) {
      const double polar = std::numbers::pi * r / n, angle = 2 * std::numbers::pi * s / sectors;
      mesh.nodes.row((r - 1) * sectors + s) << std::sin(polar) * std::cos(angle),
          std::sin(polar) * std::sin(angle), std::cos(polar);
    }
  mesh.nodes.row(inner) << 0, 0, 1;
  mesh.nodes.row(inner + 1) << 0, 0, -1;
  const auto at = [&](int r, int s) { return (r - 1) * sectors + s % sectors; };
  for (int s = 0; s < sectors; ++s) {
    mesh.triangles.push_back({inner, at(1, s), at(1, s + 1)});
    mesh.triangles.push_back({inner + 1, at(n - 1, s + 1), at(n - 1, s)});
    for (int r = 1; r + 1 < n; ++r) {
      mesh.triangles.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      mesh.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
  }
  return mesh;
}

/// A square shaken until many triangles are obtuse or folded over, stretched and lifted out of its plane.
inline Mesh shaken_surface(std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const int n = 4 + static_cast<int>(random() % 12);
  Mesh mesh = square(n, 10);
  const double shake = 10.0 / n * std::abs(uniform(random)) * 1.5;
  const double stretch = std::pow(10.0, 2 * uniform(random));
  for (Eigen::Index i = 0; i < mesh.nodes.rows(); ++i) {
    mesh.nodes.row(i) += shake * Eigen::RowVector3d(uniform(random), uniform(random), uniform(random));
    mesh.nodes(i, 0) *= stretch;
  }
  return mesh;
}

}  // namespace rhytid::testing
