#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "sim/mesh/triangle_surface.h"
#include "tests/sim/mesh/surface_testing.h"

namespace rhytid {
namespace {

using testing::HasSubstr;
using testing_support::input_error;

double area(const TriangleSurface& surface) {
  double sum = 0;
  for (const auto& [a, b, c] : surface.faces) {
    const Vec3 ab = surface.vertices.row(b) - surface.vertices.row(a);
    const Vec3 ac = surface.vertices.row(c) - surface.vertices.row(a);
    sum += ab.cross(ac).z() / 2;  // signed: a clockwise face would subtract
  }
  return sum;
}

// +1 for the diagonal from lower left to upper right, −1 for the other, by cell.
std::vector<int> diagonals(const TriangleSurface& grid, int nx, int ny) {
  std::vector<int> signs;
  for (int cell = 0; cell < nx * ny; ++cell) {
    const auto &lower = grid.faces[2 * cell], &upper = grid.faces[2 * cell + 1];
    std::vector<int> shared;
    for (const int vertex : lower)
      if (std::count(upper.begin(), upper.end(), vertex)) shared.push_back(vertex);
    EXPECT_EQ(shared.size(), 2u);
    const Vec3 along = grid.vertices.row(shared[1]) - grid.vertices.row(shared[0]);
    signs.push_back(along.x() * along.y() > 0 ? 1 : -1);
  }
  return signs;
}

TEST(GridSurface, CoversItsRectangleFacingUp) {
  for (const auto pattern :
       {GridPattern::union_jack, GridPattern::diagonal_plus, GridPattern::diagonal_minus}) {
    const TriangleSurface grid = grid_surface(12, 8, 5, 3, pattern);
    EXPECT_EQ(grid.vertices.rows(), 6 * 4);
    EXPECT_EQ(grid.faces.size(), 30u);
    EXPECT_NEAR(area(grid), 96, 1e-12);
    EXPECT_EQ(grid.vertices.colwise().minCoeff(), Eigen::RowVector3d(-6, -4, 0));
    EXPECT_EQ(grid.vertices.colwise().maxCoeff(), Eigen::RowVector3d(6, 4, 0));
    EXPECT_NO_THROW(validate_surface(grid));
  }
  EXPECT_THROW(grid_surface(1, 1, 0, 1, GridPattern::union_jack), ContractError);
  EXPECT_THROW(grid_surface(0, 1, 1, 1, GridPattern::union_jack), ContractError);
}

TEST(GridSurface, PatternsSetTheDiagonals) {
  EXPECT_THAT(diagonals(grid_surface(3, 2, 3, 2, GridPattern::diagonal_plus), 3, 2), testing::Each(1));
  EXPECT_THAT(diagonals(grid_surface(3, 2, 3, 2, GridPattern::diagonal_minus), 3, 2), testing::Each(-1));
  EXPECT_THAT(diagonals(grid_surface(3, 2, 3, 2, GridPattern::union_jack), 3, 2),
              testing::ElementsAre(1, -1, 1, -1, 1, -1));
}

TEST(CropGeodesicDisc, KeepsExactlyTheFacesWithinEdgeDistance) {
  // On one family of diagonals the edge distance from the middle is known: diagonal steps where the signs of
  // the offsets agree, axis steps else.
  const TriangleSurface grid = grid_surface(20, 20, 20, 20, GridPattern::diagonal_plus);
  const double radius = 6.3;
  const auto distance = [](double x, double y) {
    const double a = std::abs(x), b = std::abs(y);
    return x * y > 0 ? std::sqrt(2.) * std::min(a, b) + std::abs(a - b) : a + b;
  };
  std::set<int> expected;
  for (std::size_t face = 0; face < grid.faces.size(); ++face) {
    const auto inside = [&](int v) { return distance(grid.vertices(v, 0), grid.vertices(v, 1)) <= radius; };
    if (std::all_of(grid.faces[face].begin(), grid.faces[face].end(), inside)) expected.insert(face);
  }
  const TriangleSurface disc = crop_geodesic_disc(grid, Vec3(0.2, -0.1, 3), radius);
  EXPECT_EQ(std::set<int>(disc.source_face.begin(), disc.source_face.end()), expected);
  EXPECT_GT(expected.size(), 80u);
  EXPECT_NO_THROW(validate_surface(disc));
  EXPECT_TRUE(std::is_sorted(disc.source_vertex.begin(), disc.source_vertex.end()));
  for (int v = 0; v < disc.vertices.rows(); ++v)
    EXPECT_EQ(disc.vertices.row(v), grid.vertices.row(disc.source_vertex[v]));
  for (std::size_t face = 0; face < disc.faces.size(); ++face)
    for (int k = 0; k < 3; ++k)
      EXPECT_EQ(disc.source_vertex[disc.faces[face][k]], grid.faces[disc.source_face[face]][k]);
}

TEST(CropGeodesicDisc, KeepsFileNumbersWhenCroppedTwice) {
  const TriangleSurface grid = grid_surface(20, 20, 20, 20, GridPattern::union_jack);
  const TriangleSurface once = crop_geodesic_disc(grid, Vec3(3, 3, 0), 6);
  const TriangleSurface twice = crop_geodesic_disc(once, Vec3(3, 3, 0), 3);
  for (int v = 0; v < twice.vertices.rows(); ++v)
    EXPECT_EQ(twice.vertices.row(v), grid.vertices.row(twice.source_vertex[v]));
  EXPECT_LT(twice.faces.size(), once.faces.size());
}

TEST(CropGeodesicDisc, DropsContactsInASingleVertex) {
  // 3 × 3 cells without the middle and one corner cell: a ring that touches itself at a vertex.
  TriangleSurface ring = grid_surface(3, 3, 3, 3, GridPattern::diagonal_plus);
  for (const int cell : {4, 0})
    ring.faces.erase(ring.faces.begin() + 2 * cell, ring.faces.begin() + 2 * cell + 2);
  ring.vertices.row(0) = ring.vertices.row(1);  // belongs to no face any more
  EXPECT_THAT(input_error([&] {
                TriangleSurface used = ring;
                validate_surface(used);
              }),
              HasSubstr("belongs to no face"));
  const TriangleSurface opened = crop_geodesic_disc(ring, Vec3::Zero(), 100);
  EXPECT_NO_THROW(validate_surface(opened));
  EXPECT_LT(opened.faces.size(), ring.faces.size());
  EXPECT_GE(opened.faces.size(), ring.faces.size() - 4);
}

TEST(CropGeodesicDisc, KeepsTheLargestOfTheParts) {
  TriangleSurface grid = grid_surface(9, 1, 9, 1, GridPattern::diagonal_plus);
  grid.faces.erase(grid.faces.begin() + 6, grid.faces.begin() + 8);  // cell 3 of 9
  // The parts are joined by no edge, so distances from the right one never reach the left one.
  const TriangleSurface right = crop_geodesic_disc(grid, Vec3(4, 0, 0), 50);
  EXPECT_EQ(right.faces.size(), 10u);
  EXPECT_GT(right.vertices.col(0).minCoeff(), -1);
}

TEST(CropGeodesicDisc, SaysWhenNothingIsLeft) {
  const TriangleSurface grid = grid_surface(20, 20, 4, 4, GridPattern::union_jack);
  const std::string line = input_error([&] { crop_geodesic_disc(grid, Vec3(0, 0, 0), 2); });
  EXPECT_THAT(line, HasSubstr("radius 2 mm"));
  EXPECT_THAT(line, HasSubstr("vertex 13"));
}

TEST(CropGeodesicDisc, SaysWhenTheCentreIsFarAway) {
  const TriangleSurface grid = grid_surface(20, 20, 20, 20, GridPattern::union_jack);
  EXPECT_THAT(input_error([&] { crop_geodesic_disc(grid, Vec3(0, 0, 30), 10); }), HasSubstr("30 mm away"));
}

TEST(VertexNormals, ApproachTheSphere) {
  TriangleSurface cap = grid_surface(8, 8, 16, 16, GridPattern::union_jack);
  for (int v = 0; v < cap.vertices.rows(); ++v)
    cap.vertices(v, 2) = std::sqrt(100 - cap.vertices.row(v).head<2>().squaredNorm());
  for (const int passes : {0, 2}) {
    const MatrixX3 normals = vertex_normals(cap, passes);
    for (int v = 0; v < cap.vertices.rows(); ++v) {
      EXPECT_NEAR(normals.row(v).norm(), 1, 1e-14);
      EXPECT_GT(normals.row(v).dot(cap.vertices.row(v)) / 10, passes ? 0.99 : 0.998);
    }
  }
}

TEST(VertexNormals, SmoothingEvensOutASpike) {
  TriangleSurface bump = grid_surface(8, 8, 8, 8, GridPattern::union_jack);
  bump.vertices(4 * 9 + 3, 2) = 0.8;
  const auto tilt = [&](int passes) { return vertex_normals(bump, passes).col(2).minCoeff(); };
  EXPECT_LT(tilt(0), tilt(1));
  EXPECT_LT(tilt(1), tilt(4));
}

}  // namespace
}  // namespace rhytid
