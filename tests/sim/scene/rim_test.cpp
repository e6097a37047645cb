// What each rim condition holds: a squeezed sliding block stays within its four walls, corners included.
#include "sim/scene/parts/rim.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"

namespace rhytid {
namespace {

/// A soft nearly incompressible block 8 × 6 × 2 mm with a sphere that presses beside its middle, so that
/// nothing is symmetric about a diagonal.
SceneModel squeezed_block(const std::string& rim, int order = 2) {
  return SceneModel(parse_scene_text(R"({
    "name": "squeeze",
    "skin": {"surface": {"grid": {"size": [8, 6], "cells": [3, 2]}}, "order": )" +
                                         std::to_string(order) + R"(, "rim": ")" + rim + R"(",
      "layers": [{"name": "block", "thickness": 2, "order": 2, "youngs_modulus": "20 kPa",
                  "relaxing_fraction": 0}]},
    "base": {"shape": "plane", "stiffness": "1 MPa/mm"},
    "colliders": [{"name": "ball", "radius": 5, "stiffness": "1 MPa/mm",
                   "path": [{"time": 0, "position": [2, 1.5, 5]}, {"time": 0.1, "position": [2, 1.5, 4.4]}]}],
    "time": {"frame_rate": 20, "frames": 2}
  })",
                                     "squeeze.json"));
}

TEST(Rim, ASqueezedSlidingBlockStaysWithinItsWalls) {
  for (const int order : {1, 3}) {
    const SceneModel built = squeezed_block("sliding", order);
    const Trajectory run = simulate(built.model(), built.model().native, built.run_options());
    ASSERT_TRUE(run.complete) << run.failure;
    const SkinMesh& mesh = built.model().mesh;
    const VectorXd& u = run.at_frame(run.frames()).u;
    double bulge = 0, wall_slip = 0;
    for (int column : mesh.rim_columns)
      for (int level = 0; level < mesh.num_levels; ++level) {
        const int node = mesh.node(column, level);
        const Vec3 x = mesh.rest.row(node), moved = u.segment<3>(3 * node);
        const bool on_x = std::fabs(std::fabs(x.x()) - 4) < 1e-12,
                   on_y = std::fabs(std::fabs(x.y()) - 3) < 1e-12;
        ASSERT_TRUE(on_x || on_y);
        // A corner frame is turned by 45°: its zeros come back to round-off.
        if (on_x) {
          EXPECT_NEAR(moved.x(), 0, 1e-15) << x.transpose();
        }
        if (on_y) {
          EXPECT_NEAR(moved.y(), 0, 1e-15) << x.transpose();
        }
        if (on_x && on_y) bulge = std::max(bulge, std::fabs(moved.z()));
        wall_slip = std::max(wall_slip, moved.head<2>().norm());
      }
    EXPECT_GT(bulge, 1e-3) << "a corner may move along the thickness";
    if (order > 1) {
      EXPECT_GT(wall_slip, 1e-3) << "the walls slide";
    }
  }
}

TEST(Rim, OnlyCornersOfASlidingRimLoseASecondDirection) {
  const SceneModel built = squeezed_block("sliding");
  const SkinMesh& mesh = built.model().mesh;
  const Constraints& c = built.model().constraints;
  const std::vector<int> corners = rim_corners(mesh);
  EXPECT_EQ(corners.size(), 4u);
  std::set<int> held(c.fixed_unknowns.begin(), c.fixed_unknowns.end());
  EXPECT_EQ(held.size(), (mesh.rim_columns.size() + corners.size()) * mesh.num_levels);
  for (int column : corners) {
    const int block = c.block[mesh.node(column, 0)];
    EXPECT_TRUE(held.contains(3 * block) && held.contains(3 * block + 1));
    EXPECT_FALSE(held.contains(3 * block + 2));
  }
}

TEST(Rim, FreeAndClampedDoNotKnowCorners) {
  const SceneModel loose = squeezed_block("free");
  const SkinMesh& mesh = loose.model().mesh;
  EXPECT_TRUE(loose.model().constraints.fixed_unknowns.empty());
  EXPECT_TRUE(loose.model().constraints.frames.empty());
  EXPECT_EQ(static_cast<int>(loose.model().constraints.block_nodes.size()), mesh.num_nodes());
  const SceneModel held = squeezed_block("clamped");
  EXPECT_TRUE(held.model().constraints.fixed_unknowns.empty());
  EXPECT_EQ(held.model().constraints.block_nodes.size(),
            (mesh.num_columns - mesh.rim_columns.size()) * mesh.num_levels);
}

TEST(Rim, ARoundRimHasNoCornersAndAnOctagonHasEight) {
  for (const int sides : {8, 11, 24}) {
    TriangleSurface disc;
    disc.vertices.resize(sides + 1, 3);
    disc.vertices.row(sides).setZero();
    for (int i = 0; i < sides; ++i) {
      const double angle = 2 * std::numbers::pi * i / sides;
      disc.vertices.row(i) << 5 * std::cos(angle), 5 * std::sin(angle), 0;
      disc.faces.push_back({sides, i, (i + 1) % sides});
    }
    ExtrusionOptions options;
    options.layers = {{0.5}};
    const SkinMesh mesh = extrude(disc, options);
    EXPECT_EQ(rim_corners(mesh).size(), sides == 8 ? 8u : 0u);
  }
}

}  // namespace
}  // namespace rhytid
