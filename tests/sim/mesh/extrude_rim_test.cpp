#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/sim/mesh/surface_testing.h"

namespace rhytid {
namespace {

class ExtrudeRim : public testing::TestWithParam<int> {};

TEST_P(ExtrudeRim, FollowsTheRectangle) {
  const int p = GetParam(), nx = 4, ny = 3;
  ExtrusionOptions options;
  options.order = p;
  options.layers = {{1}};
  const SkinMesh mesh = extrude(grid_surface(8, 6, nx, ny, GridPattern::union_jack), options);
  ASSERT_EQ(static_cast<int>(mesh.rim_columns.size()), 2 * p * (nx + ny));
  ASSERT_EQ(mesh.rim_directions.rows(), static_cast<int>(mesh.rim_columns.size()));
  EXPECT_TRUE(std::is_sorted(mesh.rim_columns.begin(), mesh.rim_columns.end()));
  for (std::size_t i = 0; i < mesh.rim_columns.size(); ++i) {
    const Vec3 x = mesh.rest.row(mesh.node(mesh.rim_columns[i], 0));
    Vec3 outward(0, 0, 0);
    if (std::abs(std::abs(x.x()) - 4) < 1e-12) outward.x() = x.x() > 0 ? 1 : -1;
    if (std::abs(std::abs(x.y()) - 3) < 1e-12) outward.y() = x.y() > 0 ? 1 : -1;
    ASSERT_GT(outward.norm(), 0);
    EXPECT_LT((mesh.rim_directions.row(i).transpose() - outward.normalized()).norm(), 1e-13);
    const bool corner = outward.x() != 0 && outward.y() != 0;
    EXPECT_NEAR(mesh.rim_turns[i], corner ? std::numbers::pi / 2 : 0, 1e-13);
  }
}

TEST_P(ExtrudeRim, IsTangentToTheCylinder) {
  ExtrusionOptions options;
  options.order = GetParam();
  options.layers = {{1}};
  options.bend_radius = 5;
  const SkinMesh mesh = extrude(grid_surface(8, 6, 4, 3, GridPattern::union_jack), options);
  int on_ends = 0;
  for (std::size_t i = 0; i < mesh.rim_columns.size(); ++i) {
    const int column = mesh.rim_columns[i];
    const Vec3 x = mesh.surface.vertices.rows() > column
                       ? Vec3(mesh.surface.vertices.row(column))
                       : Vec3(mesh.rest.row(mesh.node(column, mesh.num_levels - 1)));
    const Vec3 direction = mesh.rim_directions.row(i);
    EXPECT_NEAR(direction.norm(), 1, 1e-14);
    EXPECT_NEAR(direction.dot(mesh.column_normals.row(column)), 0, 1e-13);
    const double angle = std::atan2(x.x(), x.z());
    if (std::abs(x.y()) < 2.99 && std::abs(angle) > 0.799) {
      const Vec3 tangent = (angle > 0 ? 1 : -1) * Vec3(std::cos(angle), 0, -std::sin(angle));
      EXPECT_LT((direction - tangent).norm(), 1e-13);
      ++on_ends;
    }
  }
  EXPECT_EQ(on_ends, 2 * (3 * GetParam() - 1));
}

INSTANTIATE_TEST_SUITE_P(Orders, ExtrudeRim, testing::Range(1, 5));

TEST(ExtrudeRim, IsEmptyOnAClosedSurface) {
  TriangleSurface octahedron;
  octahedron.vertices.resize(6, 3);
  octahedron.vertices << 5, 0, 0, -5, 0, 0, 0, 5, 0, 0, -5, 0, 0, 0, 5, 0, 0, -5;
  octahedron.faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  ExtrusionOptions options;
  options.layers = {{0.5}};
  options.surface_is_outer = false;
  const SkinMesh mesh = extrude(octahedron, options);
  EXPECT_TRUE(mesh.rim_columns.empty());
  EXPECT_EQ(mesh.num_columns, 6 + 12 * 2 + 8);  // Euler: V − E + F = 2
}

}  // namespace
}  // namespace rhytid
