#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "tests/sim/mesh/surface_testing.h"

namespace rhytid {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing_support::input_error;
using testing_support::integrate_volume;

ExtrusionOptions two_layers(int order) {
  ExtrusionOptions options;
  options.order = order;
  options.layers = {{1.0, 2, 3}, {0.2, 1, 2}};
  return options;
}

class ExtrudeOrder : public testing::TestWithParam<int> {};

TEST_P(ExtrudeOrder, SharesColumnsBetweenFaces) {
  const int p = GetParam(), nx = 5, ny = 4;
  for (const auto pattern :
       {GridPattern::union_jack, GridPattern::diagonal_plus, GridPattern::diagonal_minus}) {
    const SkinMesh mesh = extrude(grid_surface(10, 8, nx, ny, pattern), two_layers(p));
    EXPECT_EQ(mesh.num_columns, (p * nx + 1) * (p * ny + 1));  // a lattice of spacing 1/p cells
    EXPECT_EQ(mesh.num_faces, 2 * nx * ny);
    EXPECT_EQ(mesh.nodes_per_face() * mesh.num_faces, static_cast<int>(mesh.face_columns.size()));
    std::map<std::array<long, 2>, int> at;
    const double dx = 2. / p, dy = 2. / p;
    for (int column = 0; column < mesh.num_columns; ++column) {
      const Vec3 x = mesh.rest.row(mesh.node(column, 0));
      const auto [entry, is_new] =
          at.try_emplace({std::lround((x.x() + 5) / dx), std::lround((x.y() + 4) / dy)}, column);
      EXPECT_TRUE(is_new) << "columns " << column << " and " << entry->second << " coincide";
    }
    // Every face sees its columns where its own corners put them.
    const TriangleBasis basis(p);
    for (int face = 0; face < mesh.num_faces; ++face) {
      const auto [a, b, c] = mesh.surface.faces[face];
      for (int j = 0; j < basis.num_nodes(); ++j) {
        const auto [u, v] = basis.nodes()[j];
        const Vec3 expected = (1 - u - v) * mesh.surface.vertices.row(a) + u * mesh.surface.vertices.row(b) +
                              v * mesh.surface.vertices.row(c);
        EXPECT_LT((mesh.rest.row(mesh.outer_nodes(face)[j]).transpose() - expected).norm(), 1e-13);
      }
    }
  }
}

TEST_P(ExtrudeOrder, StacksLevelsFromInnerToOuter) {
  const int p = GetParam();
  const SkinMesh mesh = extrude(grid_surface(10, 8, 2, 2, GridPattern::union_jack), two_layers(p));
  ASSERT_EQ(mesh.element_layers.size(), 3u);
  ASSERT_EQ(mesh.num_levels, 3 + 3 + 2 + 1);
  EXPECT_EQ(mesh.num_elements(), 24);
  const int firsts[] = {0, 3, 6}, orders[] = {3, 3, 2}, materials[] = {0, 0, 1};
  for (int layer = 0; layer < 3; ++layer) {
    EXPECT_EQ(mesh.element_layers[layer].first_level, firsts[layer]);
    EXPECT_EQ(mesh.element_layers[layer].order, orders[layer]);
    ASSERT_EQ(mesh.element_layers[layer].slabs.size(), 1u);
    EXPECT_EQ(mesh.element_layers[layer].slabs[0].material, materials[layer]);
  }
  const double heights[] = {-1.2,          -1.2 + 0.5 / 3, -1.2 + 1. / 3, -0.7, -0.7 + 0.5 / 3,
                            -0.7 + 1. / 3, -0.2,           -0.1,          0};
  for (int column = 0; column < mesh.num_columns; ++column)
    for (int level = 0; level < mesh.num_levels; ++level)
      EXPECT_NEAR(mesh.rest(mesh.node(column, level), 2), heights[level], 1e-14);
  // Index j·(q+1)+k of an element; neighbouring element layers share a level.
  const auto lower = mesh.element_nodes(1, 3), upper = mesh.element_nodes(2, 3);
  for (int j = 0; j < mesh.nodes_per_face(); ++j) EXPECT_EQ(lower[j * 4 + 3], upper[j * 3]);
  EXPECT_EQ(mesh.element_nodes(0, 3)[4], mesh.inner_nodes(3)[1]);
}

TEST_P(ExtrudeOrder, FlatVolumesAreExactStackedAndComposite) {
  ExtrusionOptions options = two_layers(GetParam());
  const TriangleSurface grid = grid_surface(10, 8, 3, 2, GridPattern::union_jack);
  for (const bool composite : {false, true}) {
    for (const bool outer : {true, false}) {
      options.composite = composite;
      options.surface_is_outer = outer;
      const SkinMesh mesh = extrude(grid, options);
      const auto volume = integrate_volume(mesh, 2);
      EXPECT_NEAR(volume.per_material[0], 80, 1e-11);
      EXPECT_NEAR(volume.per_material[1], 16, 1e-11);
      EXPECT_GT(volume.smallest_determinant, 0);
      EXPECT_NEAR(mesh.rest.col(2).maxCoeff(), outer ? 0 : 1.2, 1e-14);
      EXPECT_NEAR(mesh.rest.col(2).minCoeff(), outer ? -1.2 : 0, 1e-14);
      if (composite) {
        ASSERT_EQ(mesh.element_layers.size(), 1u);
        const auto& slabs = mesh.element_layers[0].slabs;
        EXPECT_EQ(mesh.num_levels, options.composite_order + 1);
        EXPECT_EQ(slabs[0].w_begin, -1);
        EXPECT_NEAR(slabs[0].w_end, 2 / 1.2 - 1, 1e-15);
        EXPECT_EQ(slabs[0].w_end, slabs[1].w_begin);
        EXPECT_EQ(slabs[1].w_end, 1);
      }
    }
  }
}

// A cylindrical sector between radii r and R over the angle L/R₀ and the length B: (L/R₀) (R² − r²)/2 · B.
TEST_P(ExtrudeOrder, BentVolumesConverge) {
  const int p = GetParam();
  ExtrusionOptions options = two_layers(p);
  options.bend_radius = 6;
  for (const bool outer : {true, false}) {
    options.surface_is_outer = outer;
    const double inner_radius = outer ? 4.8 : 6;
    const auto exact = [&](double r, double R) { return 12. / 6 * (R * R - r * r) / 2 * 4; };
    const double exact_soft = exact(inner_radius, inner_radius + 1);
    const double exact_film = exact(inner_radius + 1, inner_radius + 1.2);
    std::vector<double> errors;
    for (const int n : {2, 4, 8}) {
      const TriangleSurface grid = grid_surface(12, 4, n, 1, GridPattern::union_jack);
      options.composite = false;
      const auto stacked = integrate_volume(extrude(grid, options), 2);
      options.composite = true;
      const auto composite = integrate_volume(extrude(grid, options), 2);
      EXPECT_GT(stacked.smallest_determinant, 0);
      // Both have the same geometry, hence the same volumes however coarse.
      EXPECT_NEAR(stacked.per_material[0], composite.per_material[0], 1e-11);
      EXPECT_NEAR(stacked.per_material[1], composite.per_material[1], 1e-11);
      errors.push_back(std::abs(stacked.per_material[0] - exact_soft) +
                       std::abs(stacked.per_material[1] - exact_film));
    }
    const int rate = p % 2 ? p + 1 : p + 2;  // area under an arc interpolated with equispaced nodes
    for (int i = 1; i < 3; ++i) EXPECT_LT(errors[i], 1.3 * errors[i - 1] * std::pow(0.5, rate) + 1e-12) << i;
  }
}

TEST_P(ExtrudeOrder, BentNodesLieOnTheirCylinders) {
  ExtrusionOptions options = two_layers(GetParam());
  options.bend_radius = 9;
  const SkinMesh mesh = extrude(grid_surface(12, 4, 3, 2, GridPattern::union_jack), options);
  for (int column = 0; column < mesh.num_columns; ++column) {
    for (int level = 0; level < mesh.num_levels; ++level) {
      const Vec3 x = mesh.rest.row(mesh.node(column, level));
      const double depth = -mesh.rest.row(mesh.node(column, level)).dot(mesh.column_normals.row(column)) + 9;
      EXPECT_NEAR(std::hypot(x.x(), x.z()), 9 - depth, 1e-13);
    }
    const Vec3 outer = mesh.rest.row(mesh.node(column, mesh.num_levels - 1));
    EXPECT_NEAR(std::hypot(outer.x(), outer.z()), 9, 1e-13);
    EXPECT_NEAR(mesh.column_normals.row(column).dot(Vec3(outer.x(), 0, outer.z()) / 9), 1, 1e-14);
    EXPECT_LE(std::abs(std::atan2(outer.x(), outer.z())) * 9, 6 + 1e-12);
  }
  EXPECT_NEAR(mesh.surface.vertices.row(mesh.vertex_columns[0]).norm(), std::hypot(9, 2), 1e-13);
}

TEST_P(ExtrudeOrder, CurvedFileSurfaceIsContinuousAndUnfolded) {
  TriangleSurface cap = grid_surface(12, 12, 6, 6, GridPattern::union_jack);
  for (int v = 0; v < cap.vertices.rows(); ++v)
    cap.vertices(v, 2) = std::sqrt(400 - cap.vertices.row(v).head<2>().squaredNorm());
  const SkinMesh mesh = extrude(cap, two_layers(GetParam()));
  EXPECT_GT(integrate_volume(mesh, 2).smallest_determinant, 0);
  const int last = mesh.num_levels - 1;
  for (int column = 0; column < mesh.num_columns; ++column) {
    const Vec3 across = mesh.rest.row(mesh.node(column, last)) - mesh.rest.row(mesh.node(column, 0));
    EXPECT_NEAR(across.norm(), 1.2, 1e-13);
    EXPECT_NEAR(across.dot(mesh.column_normals.row(column)), 1.2, 1e-13);
  }
  for (int v = 0; v < cap.vertices.rows(); ++v)
    EXPECT_EQ(mesh.rest.row(mesh.node(mesh.vertex_columns[v], last)), cap.vertices.row(v));
}

INSTANTIATE_TEST_SUITE_P(Orders, ExtrudeOrder, testing::Range(1, 5));

TEST(Extrude, RefusesToFoldACylinderPastItsAxis) {
  ExtrusionOptions options = two_layers(2);
  options.bend_radius = 3;
  options.layers = {{3.1}};
  const TriangleSurface grid = grid_surface(8, 4, 4, 2, GridPattern::union_jack);
  const std::string line = input_error([&] { extrude(grid, options); });
  EXPECT_THAT(line, AllOf(HasSubstr("extruding 3.1 mm inwards folds 16 of 16 faces (1, 2, 3, 4, 5, ...)"),
                          HasSubstr("thinner skin")));
  const auto at = line.find("depth of ");
  ASSERT_NE(at, std::string::npos);
  EXPECT_NEAR(std::stod(line.substr(at + 9)), 3, 0.05);
  options.layers = {{2.7}};
  EXPECT_GT(integrate_volume(extrude(grid, options), 1).smallest_determinant, 0);
  options.layers = {{3.1}};
  options.surface_is_outer = false;  // outwards there is room
  EXPECT_NO_THROW(extrude(grid, options));
}

TEST(Extrude, RefusesToFoldARidgeNamingItsFaces) {
  TriangleSurface roof = grid_surface(8, 4, 16, 4, GridPattern::diagonal_plus);
  for (int v = 0; v < roof.vertices.rows(); ++v) roof.vertices(v, 2) = -std::abs(roof.vertices(v, 0));
  ExtrusionOptions options;
  options.order = 1;
  options.layers = {{3}};
  options.normal_smoothing = 0;
  const std::string line = input_error([&] { extrude(roof, options); });
  // Cells 7 and 8 of 16 touch the ridge: in the first row faces 15 to 18.
  EXPECT_THAT(line, AllOf(HasSubstr("folds 16 of 128 faces (15, 16, 17, 18, 47, ...)"),
                          HasSubstr("curvature radius")));
  options.surface_is_outer = false;
  EXPECT_NO_THROW(extrude(roof, options));
}

TEST(Extrude, RefusesToBendWhatIsNotFlatOrTooWide) {
  ExtrusionOptions options = two_layers(2);
  options.bend_radius = 3;
  TriangleSurface grid = grid_surface(20, 4, 8, 2, GridPattern::union_jack);
  EXPECT_THAT(input_error([&] { extrude(grid, options); }),
              AllOf(HasSubstr("over itself"), HasSubstr("3.183 mm")));
  grid.vertices(3, 2) = 0.1;
  EXPECT_THAT(input_error([&] { extrude(grid, options); }), HasSubstr("flat"));
}

TEST(Extrude, RefusesBrokenOptionsAndSurfaces) {
  const TriangleSurface grid = grid_surface(8, 4, 4, 2, GridPattern::union_jack);
  EXPECT_THROW(extrude(grid, two_layers(5)), ContractError);
  EXPECT_THROW(extrude(grid, ExtrusionOptions{}), ContractError);
  ExtrusionOptions thin = two_layers(2);
  thin.layers[1].thickness = 0;
  EXPECT_THROW(extrude(grid, thin), ContractError);
  TriangleSurface broken = grid;
  broken.faces.pop_back();
  broken.faces.pop_back();
  broken.faces.push_back(broken.faces.front());
  EXPECT_THROW(extrude(broken, two_layers(2)), InputError);
}

}  // namespace
}  // namespace rhytid
