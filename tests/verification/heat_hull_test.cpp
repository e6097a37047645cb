// The ligament map between the strengths of its sources (B16, T9): any mesh, any diffusion time,
// at the nodes and at the quadrature points.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <random>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/surface/heat_map.h"
#include "tests/sim/surface/meshes.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

int obtuse_triangles(const testing::Mesh& mesh) {
  int count = 0;
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const Vec3 a = mesh.nodes.row(t[k]), b = mesh.nodes.row(t[(k + 1) % 3]),
                 c = mesh.nodes.row(t[(k + 2) % 3]);
      count += (b - a).dot(c - a) < 0;
    }
  return count;
}

TEST(HeatHull, AnyMeshAnyTime) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0, 1);
  long obtuse = 0, triangles = 0;
  std::printf(
      "t/h²: largest excursion outside the strengths / their size, nodes outside by more than rounding\n");
  for (int decade = -3; decade <= 3; ++decade) {
    double excursion = 0;
    long outside = 0, nodes = 0;
    for (int trial = 0; trial < 40; ++trial) {
      const testing::Mesh mesh = testing::shaken_surface(random);
      obtuse += obtuse_triangles(mesh);
      triangles += static_cast<long>(mesh.triangles.size());
      double area = 0;
      for (const auto& t : mesh.triangles)
        area += 0.5 * Vec3(mesh.nodes.row(t[1]) - mesh.nodes.row(t[0]))
                          .cross(Vec3(mesh.nodes.row(t[2]) - mesh.nodes.row(t[0])))
                          .norm();
      const double h2 = 2 * area / static_cast<double>(mesh.triangles.size());
      std::vector<HeatSource> sources;
      VectorXd strength(3);
      for (int s = 0; s < 3; ++s) {
        const auto node = static_cast<Eigen::Index>(random() % static_cast<unsigned>(mesh.nodes.rows()));
        sources.push_back({mesh.nodes.row(node).transpose(), std::sqrt(h2) * (0.2 + 3 * uniform(random))});
        strength[s] = 1 + 9 * uniform(random);
      }
      const VectorXd b =
          diffuse_sources(mesh.nodes, mesh.triangles, sources, h2 * std::pow(10.0, decade)).weights *
          strength;
      ASSERT_TRUE(b.allFinite());
      const double low = strength.minCoeff(), high = strength.maxCoeff();
      for (const double value : b) {
        const double out = std::max(value - high, low - value) / high;
        excursion = std::max(excursion, out);
        outside += out > 1e-14;
        ++nodes;
      }
    }
    std::printf("  1e%+d: %.1e, %ld of %ld\n", decade, excursion, outside, nodes);
    EXPECT_EQ(outside, 0);
  }
  std::printf("  %ld of %ld triangles obtuse\n", obtuse, triangles);
  EXPECT_GT(obtuse, triangles / 2);
}

// The map of a scene on quartic elements: what the ligament term sees at its points.
TEST(HeatHull, QuarticElementsAtTheirPoints) {
  for (const double time : {1e-3, 1e-1, 10.0, 1e3}) {
    const SceneModel m(parse_scene_text(
        test::drag_scene(4, 1), "hull.json",
        {"/skin/surface/grid/cells=[4,3]", "/ligaments/diffusion_time=" + std::to_string(time)}));
    int maps = 0;
    for (const Term& term : m.model().terms) {
      if (term.name() != "ligaments") continue;
      ++maps;
      double low = 1e300, high = -1e300;
      for (const auto& group : term.load_theta({0, 0, 1}, m.native()))
        for (std::size_t k = 2; k < group.size(); k += 3) {
          low = std::min(low, group[k]);
          high = std::max(high, group[k]);
        }
      std::printf("  quartic patch, t = %g mm²: b at the points %.6f .. %.6f, strengths 0.5 and 3\n", time,
                  low, high);
      EXPECT_GE(low, 0.5 * (1 - 1e-14));
      EXPECT_LE(high, 3 * (1 + 1e-14));
      EXPECT_LT(low, high);
    }
    EXPECT_EQ(maps, 1);
  }
}

}  // namespace
}  // namespace rhytid
