// Bone from a cloud of points: the scene of its own inner surface again, both kernels, and what is refused.
#include "sim/scene/parts/base_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/temporary_folder.h"

namespace rhytid {
namespace {

using testing::HasSubstr;

SceneModel pressed_skin(const std::vector<std::string>& settings) {
  return SceneModel(parse_scene_text(R"({
    "name": "bone",
    "skin": {"surface": {"grid": {"size": [10, 8], "cells": [4, 3], "bend_radius": 25}}, "order": 2, "rim": "free",
      "layers": [{"name": "skin", "thickness": 1.5, "order": 2, "youngs_modulus": "20 kPa",
                  "relaxing_fraction": 0}]},
    "base": {"shape": "imls", "imls_support": 5, "stiffness": "0.1 MPa/mm", "onset": "0.02 mm"},
    "ligaments": {"sources": [{"name": "one", "position": [0, 0, 23], "strength": 1}]},
    "colliders": [{"name": "ball", "radius": 5, "stiffness": "0.1 MPa/mm", "onset": "0.02 mm",
                   "path": [{"time": 0, "position": [1, 0.5, 30]}, {"time": 0.1, "position": [1, 0.5, 29.4]}]}],
    "time": {"frame_rate": 20, "frames": 2}
  })",
                                     "bone.json", settings));
}

VectorXd end_of(const SceneModel& built) {
  const Trajectory run = simulate(built.model(), built.model().native, built.run_options());
  EXPECT_TRUE(run.complete) << run.failure;
  return run.at_frame(run.frames()).u;
}

/// The inner nodes and column normals as .xyz, in metres, the normals times `sign`.
std::string write_inner(const SkinMesh& mesh, const std::string& path, double sign) {
  std::ofstream file(path);
  for (int c = 0; c < mesh.num_columns; ++c) {
    const Vec3 x = mesh.rest.row(mesh.node(c, 0)) / 1000, n = sign * mesh.column_normals.row(c);
    char line[256];
    std::snprintf(line, sizeof line, "%.17g %.17g %.17g %.17g %.17g %.17g\n", x[0], x[1], x[2], n[0], n[1],
                  n[2]);
    file << line;
  }
  return path;
}

TEST(BasePart, ACloudOfTheInnerSurfaceIsTheInnerSurface) {
  const test::TemporaryFolder folder;
  for (const std::string kernel : {"smooth", "literal"}) {
    const SceneModel own = pressed_skin({"/base/imls_kernel=" + kernel});
    const std::string path = write_inner(own.model().mesh, folder / "inner.xyz", 3);
    const SceneModel cloud = pressed_skin(
        {"/base/imls_kernel=" + kernel, R"(/base/points={"file": ")" + path + R"(", "unit": "m"})"});
    const VectorXd a = end_of(own), b = end_of(cloud);
    EXPECT_GT(a.norm(), 0.1);
    EXPECT_LT((a - b).norm(), 1e-9 * a.norm()) << kernel;
  }
}

TEST(BasePart, TheKernelsDiffer) {
  const VectorXd smooth = end_of(pressed_skin({}));
  const VectorXd literal = end_of(pressed_skin({"/base/imls_kernel=literal"}));
  EXPECT_GT((smooth - literal).norm(), 1e-6 * smooth.norm());
  EXPECT_LT((smooth - literal).norm(), 0.1 * smooth.norm());
}

TEST(BasePart, RefusesCloudsThatAreNoBoneOfThisSkin) {
  const test::TemporaryFolder folder;
  const SceneModel own = pressed_skin({});
  const auto refusal = [](const std::vector<std::string>& settings) -> std::string {
    try {
      (void)pressed_skin(settings);
    } catch (const InputError& error) {
      return error.what();
    }
    return "not refused";
  };
  const auto points = [](const std::string& path) {
    return R"(/base/points={"file": ")" + path + R"(", "mm_per_unit": 1000})";
  };
  EXPECT_THAT(refusal({points(write_inner(own.model().mesh, folder / "in.xyz", -1))}),
              HasSubstr("away from the skin"));
  EXPECT_THAT(refusal({points(folder / "absent.xyz")}), HasSubstr("absent.xyz"));
  std::ofstream(folder / "far.xyz") << "1 0 0 0 0 1\n1.001 0 0 0 0 1\n";
  EXPECT_THAT(refusal({points(folder / "far.xyz")}), HasSubstr("/base/imls_support"));
  EXPECT_THAT(refusal({"/base/imls_support=0", points(folder / "far.xyz")}),
              HasSubstr("got 3 mm (three times the spacing of the points)"));
  EXPECT_THAT(refusal({"/base/shape=plane", points(folder / "far.xyz")}), HasSubstr("only the shape imls"));
  // The ending in capitals is the same format.
  EXPECT_EQ(refusal({"/base/imls_support=5", points(write_inner(own.model().mesh, folder / "in.XYZ", 1))}),
            "not refused");
}

TEST(BasePart, RefusesShapesThatFaceAway) {
  const auto refusal = [](const std::vector<std::string>& settings) -> std::string {
    try {
      (void)pressed_skin(settings);
    } catch (const InputError& error) {
      return error.what();
    }
    return "not refused";
  };
  EXPECT_EQ(refusal({"/base/shape=plane"}), "not refused");
  EXPECT_THAT(refusal({"/base/shape=plane", "/base/normal=[0, 0, -1]"}),
              HasSubstr("bone.json: /base/normal: got a plane that faces away from the skin"));
  EXPECT_EQ(refusal({"/base/shape=sphere", "/base/radius=20"}), "not refused");
  EXPECT_THAT(refusal({"/base/shape=sphere", "/base/radius=5", "/base/centre=[0, 0, 60]"}),
              HasSubstr("/base/centre"));
}

TEST(BasePart, SaysHowFarTheBoneIsFromTheSkinAtRest) {
  const auto [lowest, highest] =
      base_rest_gaps(pressed_skin({"/base/shape=sphere", "/base/radius=20"}).model());
  // The inner surface is a cylinder of 23.5 mm, 8 mm wide, with facets.
  EXPECT_NEAR(lowest, 3.5, 0.3);
  EXPECT_LT(lowest, highest);
  EXPECT_NEAR(highest, std::hypot(23.5, 4) - 20, 0.3);
}

}  // namespace
}  // namespace rhytid
