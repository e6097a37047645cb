#include "sim/surface/project_to_surface.h"

#include <gtest/gtest.h>

#include <random>

#include "meshes.h"
#include "sim/core/error.h"

namespace rhytid {
namespace {

Vec3 random_vector(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  return {uniform(random), uniform(random), uniform(random)};
}

TEST(ProjectToSurface, SatisfiesTheOptimalityConditionOfAConvexTriangle) {
  // p is the closest point of a triangle iff (x − p)·(c − p) ≤ 0 for its three corners c.
  std::mt19937 random(61);
  for (int trial = 0; trial < 2000; ++trial) {
    MatrixX3 nodes(3, 3);
    for (int k = 0; k < 3; ++k) nodes.row(k) = random_vector(random, 1).transpose();
    if (trial % 5 == 0) nodes.row(2) = 0.3 * nodes.row(0) + 0.7 * nodes.row(1);  // flat
    if (trial % 50 == 0) nodes.row(1) = nodes.row(2) = nodes.row(0);             // a point
    const Vec3 x = random_vector(random, 2);
    const SurfacePoint p = project_to_surface(nodes, {{0, 1, 2}}, x);
    EXPECT_EQ(p.triangle, 0);
    EXPECT_GE(p.barycentric.minCoeff(), 0);
    EXPECT_NEAR(p.barycentric.sum(), 1, 1e-15);
    EXPECT_LT((nodes.transpose() * p.barycentric - p.point).norm(), 1e-14);
    EXPECT_NEAR(p.distance, (x - p.point).norm(), 1e-14);
    for (int k = 0; k < 3; ++k) EXPECT_LE((x - p.point).dot(nodes.row(k).transpose() - p.point), 1e-10);
  }
}

TEST(ProjectToSurface, FindsTheClosestOfManyTriangles) {
  std::mt19937 random(62);
  const testing::Mesh mesh = testing::shaken_surface(random);
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3 x = random_vector(random, 15);
    const SurfacePoint p = project_to_surface(mesh.nodes, mesh.triangles, x);
    for (const auto& triangle : mesh.triangles)
      EXPECT_GE(project_to_surface(mesh.nodes, {triangle}, x).distance, (1 - 1e-14) * p.distance);
  }
}

TEST(ProjectToSurface, KeepsPointsThatLieOnTheSurface) {
  const testing::Mesh mesh = testing::square(8, 4);
  const Vec3 x(1.3, 2.9, 0);
  for (const double lift : {0.0, 0.5, -2.0}) {
    const SurfacePoint p = project_to_surface(mesh.nodes, mesh.triangles, x + lift * Vec3::UnitZ());
    EXPECT_LT((p.point - x).norm(), 1e-14);
    EXPECT_NEAR(p.distance, std::abs(lift), 1e-14);
  }
  EXPECT_LT((project_to_surface(mesh.nodes, mesh.triangles, Vec3(-3, 5, 1)).point - Vec3(0, 4, 0)).norm(),
            1e-15);
}

// Beside an edge, above the face: distances to both faces are the same number, and only one is right.
TEST(ProjectToSurface, FollowsSmallMovesAcrossEdgesAndCorners) {
  const testing::Mesh mesh = testing::square(8, 4);
  for (const Vec3& on : {Vec3(2, 1, 0), Vec3(2, 0.3, 0), Vec3(1.7, 2, 0), Vec3(0.6, 0.6, 0)})
    for (const double lift : {0.0, 1.65, -1.65})
      for (double step = 1e-12; step < 1e-5; step *= 10)
        for (int k = 0; k < 8; ++k) {
          const double angle = (k + 0.3) * EIGEN_PI / 4;
          const Vec3 x = on + step * Vec3(std::cos(angle), std::sin(angle), 0);
          const Vec3 p = project_to_surface(mesh.nodes, mesh.triangles, x + lift * Vec3::UnitZ()).point;
          EXPECT_LT((p - x).norm(), 2e-15) << on.transpose() << ", " << lift << ", " << step << ", " << k;
        }
}

TEST(ProjectToSurface, RefusesAnEmptyOrBrokenMesh) {
  const testing::Mesh mesh = testing::square(2, 1);
  EXPECT_THROW(project_to_surface(mesh.nodes, {}, Vec3::Zero()), ContractError);
  EXPECT_THROW(project_to_surface(mesh.nodes, {{0, 1, 100}}, Vec3::Zero()), ContractError);
  EXPECT_THROW(project_to_surface(mesh.nodes, mesh.triangles, Vec3(0, std::nan(""), 0)), ContractError);
}

}  // namespace
}  // namespace rhytid
