// Loop subdivision: counts, places, planes stay planes, edges become smooth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "sim/mesh/surface_edges.h"
#include "sim/mesh/triangle_surface.h"
#include "tests/sim/mesh/surface_testing.h"

namespace rhytid {
namespace {

TriangleSurface octahedron() {
  TriangleSurface s;
  s.vertices.resize(6, 3);
  s.vertices << 10, 0, 0, -10, 0, 0, 0, 10, 0, 0, -10, 0, 0, 0, 10, 0, 0, -10;
  s.faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  s.origin = "octahedron";
  return s;
}

TEST(Subdivide, EachPassMakesFourFacesOfOne) {
  const TriangleSurface fine = subdivide_surface(octahedron(), 2);
  EXPECT_EQ(fine.faces.size(), 8u * 16);
  EXPECT_EQ(fine.vertices.rows(), 66);  // Euler: V = E − F + 2, E = 3F/2
  validate_surface(fine);
  EXPECT_EQ(fine.source_face.size(), fine.faces.size());
  EXPECT_EQ(*std::max_element(fine.source_face.begin(), fine.source_face.end()), 7);
}

TEST(Subdivide, PlacesVerticesAsLoopDoes) {
  const TriangleSurface fine = subdivide_surface(octahedron(), 1);
  // Valence 4: 3/32 of each neighbour, whose sum is zero; 1 − 4 · 3/32 of itself.
  EXPECT_NEAR((Vec3(fine.vertices.row(0)) - Vec3(6.25, 0, 0)).norm(), 0, 1e-12);
  // On an edge: 3/8 of its ends; 1/8 of the two opposite corners, which cancel.
  double nearest = 1e300;
  for (int v = 6; v < fine.vertices.rows(); ++v)
    nearest = std::min(nearest, (Vec3(fine.vertices.row(v)) - Vec3(3.75, 3.75, 0)).norm());
  EXPECT_NEAR(nearest, 0, 1e-12);
}

TEST(Subdivide, SmoothsEdges) {
  const auto sharpest = [](const TriangleSurface& s) {
    const auto normal = [&s](int face) {
      const Vec3 a = s.vertices.row(s.faces[face][0]), b = s.vertices.row(s.faces[face][1]),
                 c = s.vertices.row(s.faces[face][2]);
      return Vec3((b - a).cross(c - a).normalized());
    };
    double largest = 0;
    for (const SurfaceEdge& edge : SurfaceEdges(s.faces).edges)
      largest = std::max(largest, std::acos(normal(edge.sides[0] / 3).dot(normal(edge.sides[1] / 3))));
    return largest;
  };
  // At a vertex of valence 4 the scheme's eigenvalues are 3/8 (tangents) and 1/4 (curvature): in the long run
  // each pass takes two thirds of the angle between neighbours.
  const double sixth = sharpest(subdivide_surface(octahedron(), 6)),
               fifth = sharpest(subdivide_surface(octahedron(), 5));
  EXPECT_NEAR(sixth / fifth, 2. / 3, 0.02);
}

TEST(Subdivide, AFlatGridStaysFlatAndItsStraightRimsStraight) {
  const TriangleSurface grid = grid_surface(12, 8, 3, 2, GridPattern::union_jack);
  const TriangleSurface fine = subdivide_surface(grid, 2);
  EXPECT_EQ(fine.vertices.col(2).cwiseAbs().maxCoeff(), 0);
  // Corners are rounded, straight sides are not: their extreme coordinate stays.
  EXPECT_NEAR(fine.vertices.col(0).maxCoeff(), 6, 1e-12);
  EXPECT_NEAR(fine.vertices.col(1).minCoeff(), -4, 1e-12);
}

TEST(Subdivide, TheRimIsACubicBSplineOfItsVertices) {
  const TriangleSurface grid = grid_surface(12, 8, 3, 2, GridPattern::union_jack);
  const TriangleSurface fine = subdivide_surface(grid, 1);
  const int corner = static_cast<int>(grid.vertices.rows()) - 1;
  ASSERT_EQ(Vec3(grid.vertices.row(corner)), Vec3(6, 4, 0));
  // 3/4 of itself, 1/8 of its neighbours on the rim, (2, 4) and (6, 0).
  EXPECT_LT((Vec3(fine.vertices.row(corner)) - Vec3(5.5, 3.5, 0)).norm(), 1e-12);
  // New vertices of the rim lie half way, whatever is opposite.
  double nearest = 1e300;
  for (Eigen::Index v = grid.vertices.rows(); v < fine.vertices.rows(); ++v)
    nearest = std::min(nearest, (Vec3(fine.vertices.row(v)) - Vec3(4, 4, 0)).norm());
  EXPECT_LT(nearest, 1e-12);
}

// 7200 faces become 29 million in six passes and 8450 would become 35 million, before anything is allocated.
TEST(Subdivide, RefusesMoreFacesThanCanBeCounted) {
  const TriangleSurface grid = grid_surface(130, 130, 65, 65, GridPattern::union_jack);
  EXPECT_THAT(
      testing_support::input_error([&] { subdivide_surface(grid, 6); }),
      testing::HasSubstr("got 8450 faces to subdivide 6 times into 34611200, expected at most 33554431"));
}

TEST(Subdivide, RefusesWhatCannotBeExtrudedAnyway) {
  TriangleSurface broken = octahedron();
  broken.faces.push_back({0, 2, 4});
  EXPECT_NE(testing_support::input_error([&] { subdivide_surface(broken, 1); }), "");
}

}  // namespace
}  // namespace rhytid
