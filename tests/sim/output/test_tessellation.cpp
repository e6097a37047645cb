#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "sim/core/error.h"
#include "sim/output/surface_tessellation.h"
#include "tests/sim/output/sample_mesh.h"

namespace rhytid {
namespace {

using test::sample_displacement;
using test::sample_mesh;

TEST(SubdividedSurface, CountsAndWelding) {
  const SkinMesh mesh = sample_mesh(3, {2}, 2);
  const int n = 4;
  const SubdividedSurface surface(mesh, SurfaceSide::outer, n);
  EXPECT_EQ(surface.num_vertices(), 8 * 15);
  EXPECT_EQ(surface.triangles().size(), 8u * 16);
  EXPECT_EQ(surface.face_of_triangle(37), 2);
  // A 2 × 2 grid of squares cut n times has (2n + 1)² different points.
  const std::set<int> different(surface.welded().begin(), surface.welded().end());
  EXPECT_EQ(different.size(), 81u);
  const MatrixX3 x = surface.positions(sample_displacement(mesh));
  for (int i = 0; i < surface.num_vertices(); ++i) {
    EXPECT_NEAR((x.row(i) - x.row(surface.welded()[i])).norm(), 0, 1e-14);
  }
  // Every inner edge of the welded surface is used once in each direction: watertight and oriented.
  std::map<std::pair<int, int>, int> uses;
  for (const auto& t : surface.triangles()) {
    for (int k = 0; k < 3; ++k) ++uses[{surface.welded()[t[k]], surface.welded()[t[(k + 1) % 3]]}];
  }
  int rim = 0;
  for (const auto& [edge, count] : uses) {
    EXPECT_EQ(count, 1);
    rim += !uses.count({edge.second, edge.first});
  }
  EXPECT_EQ(rim, 4 * 2 * n);
}

TEST(SubdividedSurface, ReproducesPolynomialsOfTheElementOrder) {
  for (int p = 1; p <= 4; ++p) {
    SkinMesh mesh = sample_mesh(p, {1, 2});
    // Replace the bent mesh by the graph of a polynomial of degree p over a flat one.
    const auto height = [p](double x, double y) {
      return 0.3 * std::pow(x + 0.5 * y, p) - 0.2 * std::pow(y, p - 1);
    };
    const auto slope_x = [p](double x, double y) { return 0.3 * p * std::pow(x + 0.5 * y, p - 1); };
    const auto slope_y = [p](double x, double y) {
      return 0.15 * p * std::pow(x + 0.5 * y, p - 1) - (p > 1 ? 0.2 * (p - 1) * std::pow(y, p - 2) : 0.0);
    };
    const TriangleBasis basis(p);
    for (int face = 0; face < mesh.num_faces; ++face) {
      for (int j = 0; j < basis.num_nodes(); ++j) {
        const auto [u, v] = basis.nodes()[j];
        const Vec2 at = face == 0 ? Vec2(u, v) : Vec2(1 - u, 1 - v);
        for (int level = 0; level < mesh.num_levels; ++level) {
          mesh.rest.row(mesh.node(mesh.face_columns[face * basis.num_nodes() + j], level)) << at.x(), at.y(),
              height(at.x(), at.y()) + 0.1 * level;
        }
      }
    }
    for (const SurfaceSide side : {SurfaceSide::inner, SurfaceSide::outer}) {
      const double offset = side == SurfaceSide::inner ? 0 : 0.1 * (mesh.num_levels - 1);
      const SubdividedSurface surface(mesh, side, 7);
      const MatrixX3 x = surface.positions({}), n = surface.normals({}), smooth = surface.smooth_normals({});
      for (int i = 0; i < surface.num_vertices(); ++i) {
        EXPECT_NEAR(x(i, 2), height(x(i, 0), x(i, 1)) + offset, 1e-13);
        const Vec3 exact = Vec3(-slope_x(x(i, 0), x(i, 1)), -slope_y(x(i, 0), x(i, 1)), 1).normalized();
        EXPECT_NEAR((Vec3(n.row(i)) - exact).norm(), 0, 1e-12);
        EXPECT_NEAR((Vec3(smooth.row(i)) - exact).norm(), 0, 1e-12);
      }
      for (const auto& t : surface.triangles()) {
        const Vec3 a = x.row(t[0]), b = x.row(t[1]), c = x.row(t[2]);
        EXPECT_GT((b - a).cross(c - a).z(), 0);
      }
    }
  }
}

TEST(SubdividedSurface, RowsScalarsAndNormalDisplacement) {
  const SkinMesh mesh = sample_mesh(4, {3}, 2);
  const SubdividedSurface surface(mesh, SurfaceSide::outer, 5);
  const VectorXd u = sample_displacement(mesh);
  const MatrixX3 x = surface.positions(u);
  VectorXd per_node(mesh.num_nodes()), per_column(mesh.num_columns);
  for (int c = 0; c < mesh.num_columns; ++c) {
    const int node = mesh.node(c, mesh.num_levels - 1);
    per_column[c] = mesh.rest(node, 0) + u[3 * node];
    for (int level = 0; level < mesh.num_levels; ++level)
      per_node[mesh.node(c, level)] = -100;  // other levels unused
    per_node[node] = per_column[c];
  }
  const VectorXd a = surface.interpolate(per_column), b = surface.interpolate(per_node);
  for (int i = 0; i < surface.num_vertices(); ++i) {
    EXPECT_NEAR(a[i], x(i, 0), 1e-14);
    EXPECT_NEAR(b[i], x(i, 0), 1e-14);
    const SubdividedSurface::Row row = surface.row(i);
    double sum = 0, y = 0;
    for (int k = 0; k < row.size; ++k) {
      sum += row.weights[k];
      y += row.weights[k] * (mesh.rest(row.nodes[k], 1) + u[3 * row.nodes[k] + 1]);
    }
    EXPECT_NEAR(sum, 1, 1e-13);
    EXPECT_NEAR(y, x(i, 1), 1e-14);
  }
  // A constant shift s moves every point by s·N along its normal.
  VectorXd shift(3 * mesh.num_nodes());
  for (int n = 0; n < mesh.num_nodes(); ++n) shift.segment<3>(3 * n) << 0.1, -0.2, 0.3;
  const VectorXd height = surface.normal_displacement(shift);
  const MatrixX3 normals = surface.normals({});
  for (int i = 0; i < surface.num_vertices(); ++i) {
    EXPECT_NEAR(height[i], normals.row(i).dot(Eigen::RowVector3d(0.1, -0.2, 0.3)), 1e-14);
  }
  EXPECT_THROW(surface.interpolate(VectorXd::Zero(3)), ContractError);
  EXPECT_THROW(surface.positions(VectorXd::Zero(3)), ContractError);
  EXPECT_THROW(SubdividedSurface(mesh, SurfaceSide::outer, 0), ContractError);
}

}  // namespace
}  // namespace rhytid
