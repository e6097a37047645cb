// Samples follow the outer surface: heights of known displacements, points beside the surface.
#include "sim/output/surface_samples.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rhytid {
namespace {

SkinMesh patch(double bend_radius) {
  ExtrusionOptions options;
  options.order = 3;
  options.layers = {{2.0, 1, 2}};
  options.bend_radius = bend_radius;
  options.normal_smoothing = 0;
  return extrude(grid_surface(20, 12, 6, 4, GridPattern::union_jack), options);
}

/// Each column moved along its normal by f(arc length or x, y).
template <class F>
VectorXd lifted(const SkinMesh& mesh, F f) {
  VectorXd u = VectorXd::Zero(3 * mesh.num_nodes());
  for (int column = 0; column < mesh.num_columns; ++column) {
    const Vec3 x = mesh.rest.row(mesh.node(column, mesh.num_levels - 1)).transpose();
    for (int level = 0; level < mesh.num_levels; ++level)
      u.segment<3>(3 * mesh.node(column, level)) = f(x) * mesh.column_normals.row(column).transpose();
  }
  return u;
}

TEST(SurfaceSamples, ACubicOnAFlatPatchIsReadExactly) {
  const SkinMesh mesh = patch(0);
  const auto f = [](const Vec3& x) { return 0.1 * x[0] + 0.01 * x[0] * x[1] - 0.002 * x[0] * x[0] * x[0]; };
  const SurfaceSamples line(mesh, SampleLine{{-9, 2, 0}, {9, -1, 0}}, 181);
  EXPECT_EQ(line.missing(), 0);
  EXPECT_NEAR(line.spacing(), std::hypot(18, 3) / 180, 1e-12);
  const MatrixXd h = line.heights(lifted(mesh, f));
  for (int i = 0; i <= 180; ++i)
    EXPECT_NEAR(h(i, 0), f(Vec3(-9 + 18. * i / 180, 2 - 3. * i / 180, 0)), 1e-12);
}

TEST(SurfaceSamples, PointsBesideThePatchAreLeftOut) {
  const SkinMesh mesh = patch(0);
  SampleWindow window;
  window.size = {30, 8};
  const SurfaceSamples samples(mesh, window, 0.5);
  EXPECT_EQ(samples.rows(), 61);
  EXPECT_EQ(samples.columns(), 17);
  EXPECT_EQ(samples.missing(), 20 * 17);
  const MatrixXd h = samples.heights(lifted(mesh, [](const Vec3& x) { return x[1]; }));
  EXPECT_TRUE(std::isnan(h(3, 8)));
  EXPECT_NEAR(h(30, 0), -4, 1e-12);
  EXPECT_NEAR(h(30, 16), 4, 1e-12);
  // The same points by their faces: the interpolated rest position is where the grid has them.
  ASSERT_EQ(samples.places().size(), 61u * 17u);
  EXPECT_EQ(samples.places()[8 * 61 + 3].face, -1);
  const SurfaceSamples::Place& at = samples.places()[16 * 61 + 40];  // (5, 4)
  const TriangleBasis basis(mesh.order);
  std::vector<double> weights(static_cast<std::size_t>(mesh.nodes_per_face()));
  basis.evaluate(at.u, at.v, weights.data(), nullptr, nullptr);
  Vec3 x = Vec3::Zero();
  for (std::size_t k = 0; k < weights.size(); ++k)
    x += weights[k] * mesh.rest.row(mesh.outer_nodes(at.face)[k]).transpose();
  EXPECT_NEAR((x - Vec3(5, 4, 0)).norm(), 0, 1e-12);
}

TEST(SurfaceSamples, AWindowHoldsThePointsAtItsEnds) {
  SampleWindow window;
  window.size = {0.6, 4.4};  // 2.9999999999999996 and 22.000000000000004 times 0.2
  const SurfaceSamples samples(patch(0), window, 0.2);
  EXPECT_EQ(samples.rows(), 4);
  EXPECT_EQ(samples.columns(), 23);
  window.size = {0.79, 0.41};
  const SurfaceSamples inside(patch(0), window, 0.2);
  EXPECT_EQ(inside.rows(), 4);
  EXPECT_EQ(inside.columns(), 3);
}

TEST(SurfaceSamples, OnACylinderHeightsAreAlongItsNormals) {
  const SkinMesh mesh = patch(15);
  // The chord lies under the surface; its points are moved out to it.
  const double half = 0.5;  // rad
  const SampleLine line{{-15 * std::sin(half), 0, 15 * std::cos(half)},
                        {15 * std::sin(half), 0, 15 * std::cos(half)}};
  // So close together that the angle between facets and normals shows.
  const SurfaceSamples samples(mesh, line, 1001);
  EXPECT_EQ(samples.missing(), 0);
  EXPECT_NEAR(samples.spacing(), 15 * 2 * half / 1000, 2e-3 * 0.015);
  const MatrixXd h = samples.heights(lifted(mesh, [](const Vec3&) { return 0.3; }));
  for (int i = 0; i <= 1000; ++i) EXPECT_NEAR(h(i, 0), 0.3, 1e-3);
}

}  // namespace
}  // namespace rhytid
