// What /skin/surface makes of a mesh file: crops, lists, units, seams.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <limits>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/scene/scene_surface.h"
#include "sim/scene/vertex_values.h"

namespace rhytid {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string write(const std::string& name, const std::string& text) {
  const std::string path = testing::TempDir() + "rhytid_scene_surface_" + name;
  std::ofstream(path) << text;
  return path;
}

/// A grid of `n` × `n` squares of side `edge` as OBJ, and a vertex that no face uses in front.
std::string grid_obj(int n, double edge) {
  std::string text = "v 999 999 999\n";
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i)
      text += "v " + std::to_string(edge * i) + " " + std::to_string(edge * j) + " 0\n";
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = 2 + i + (n + 1) * j;
      text += "f " + std::to_string(a) + " " + std::to_string(a + 1) + " " + std::to_string(a + n + 2) + " " +
              std::to_string(a + n + 1) + "\n";
    }
  return text;
}

Scene scene_with(const std::string& surface) {
  return parse_scene_text(R"({"skin": {"surface": )" + surface +
                              R"(, "layers": [{"name": "soft", "thickness": 1, "youngs_modulus": 0.02}]}})",
                          "a.json");
}
TriangleSurface surface_of(const std::string& surface) {
  return scene_surface(scene_with(surface).skin.surface);
}
template <class Action>
std::string refusal(Action&& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(SceneSurface, CropsByEveryKind) {
  const std::string file = R"({"file": ")" + write("grid.obj", grid_obj(20, 4)) + R"(", "crop": )";
  EXPECT_EQ(surface_of(file + R"({"box": {"low": [-1, -1, -1], "high": ["1 cm", 9, 1]}}})").faces.size(), 8u);
  const auto around = [&](const char* by) {
    return surface_of(file + R"({"centre": [40, 40, 0], "radius": 20, "by": ")" + by + "\"}}").faces.size();
  };
  EXPECT_GT(around("distance"), around("geodesic"));  // edge paths are longer than straight lines
  const std::string list = write("list.txt", "# corner\n1, 2\t22 23 # square\n");
  const TriangleSurface square = surface_of(file + R"({"vertices_file": ")" + list + "\"}}");
  EXPECT_EQ(square.faces.size(), 2u);
  EXPECT_EQ(square.source_vertex, (std::vector<int>{1, 2, 22, 23}));
  EXPECT_EQ(surface_of(file + R"({"vertices": [1, 2, 22, 23]}})").faces, square.faces);
  EXPECT_THAT(refusal([&] { read_vertex_list(write("bad.txt", "1 2\n3 x\n")); }), HasSubstr("bad.txt:2"));
}

TEST(SceneSurface, RefusesMoreOrLessThanOneCrop) {
  const std::string file = R"({"file": "a.obj", "crop": )";
  EXPECT_THAT(refusal([&] { scene_with(file + "{}}"); }), HasSubstr("exactly one of"));
  EXPECT_THAT(refusal([&] { scene_with(file + R"({"vertices": [1, 2, 3], "vertices_file": "b"}})"); }),
              AllOf(HasSubstr("\"vertices\", \"vertices_file\""), HasSubstr("a.json:1")));
  EXPECT_THAT(refusal([&] { scene_with(file + R"({"box": {"low": [0, 0, 0], "high": [1, -1, 1]}}})"); }),
              HasSubstr("low below high"));
  EXPECT_THAT(refusal([&] { scene_with(file + R"({"radius": 3}})"); }), HasSubstr("centre"));
}

TEST(SceneSurface, SurvivesWritingAndReading) {
  for (const char* crop : {R"({"centre": [1, 2, 3], "radius": 4, "by": "distance"})",
                           R"({"box": {"low": [0, 0, 0], "high": [1, 2, 3]}})", R"({"vertices": [3, 4, 5]})",
                           R"({"vertices_file": "/a/list.txt"})"}) {
    const Scene scene =
        scene_with(std::string(R"({"file": "/a/b.ply", "coincident": "keep", "crop": )") + crop + "}");
    const nlohmann::json written = scene_to_json(scene);
    EXPECT_EQ(scene_to_json(parse_scene(written, "a.json")), written) << crop;
    EXPECT_TRUE(written["skin"]["surface"]["crop"].contains(nlohmann::json::parse(crop).begin().key()));
    EXPECT_FALSE(written["skin"]["surface"].contains("mm_per_unit"));
  }
}

TEST(SceneSurface, AsksForTheUnitWhenTheSizeIsDoubtful) {
  const std::string metres = write("metres.obj", grid_obj(10, 0.025)),
                    head = write("head.obj", grid_obj(10, 25));
  EXPECT_THAT(refusal([&] { surface_of(R"({"file": ")" + metres + "\"}"); }),
              HasSubstr("extent 0.25: metres? set mm_per_unit 1000"));
  EXPECT_EQ(surface_of(R"({"file": ")" + metres + R"(", "unit": "m"})").vertices.maxCoeff(), 250);
  EXPECT_EQ(surface_of(R"({"file": ")" + head + "\"}").vertices.maxCoeff(), 250);
}

TEST(SceneSurface, RefusesAnOpenSeamUnlessTold) {
  std::string text = grid_obj(2, 50);
  const std::string seam = write("seam.obj", text + "v 100 0 0\nv 100 50 0\nv 150 0 0\nf 11 13 12\n");
  EXPECT_THAT(refusal([&] { surface_of(R"({"file": ")" + seam + "\"}"); }),
              AllOf(HasSubstr("2 vertices lie exactly on another one"), HasSubstr("vertex 11 on vertex 4")));
  EXPECT_EQ(surface_of(R"({"file": ")" + seam + R"(", "coincident": "join"})").vertices.rows(), 10);
  EXPECT_EQ(surface_of(R"({"file": ")" + seam + R"(", "coincident": "keep"})").vertices.rows(), 12);
}

TEST(SceneSurface, ValuesPerVertexMayNameEitherOfTwoJoinedVertices) {
  const std::string seam =
      write("mapped.obj", grid_obj(2, 50) + "v 100 0 0\nv 100 50 0\nv 150 0 0\nf 11 13 12\n");
  const TriangleSurface joined = surface_of(R"({"file": ")" + seam + R"(", "coincident": "join"})");
  const double none = std::numeric_limits<double>::quiet_NaN();
  const auto on_vertices = [&](std::vector<double> values) {
    return on_surface_vertices(joined, values, "a.json: /map");
  };
  // From 0, vertex 10 lies on 3 and 11 on 6; no face uses vertex 0.
  const VectorXd expected = on_vertices({none, 1, 2, 30, 4, 5, 60, 7, 8, 9, none, none, 12});
  EXPECT_EQ(expected, on_vertices({none, 1, 2, none, 4, 5, 60, 7, 8, 9, 30, none, 12}));
  EXPECT_EQ(expected, on_vertices({none, 1, 2, 30, 4, 5, 60, 7, 8, 9, 30, 60, 12}));
  EXPECT_EQ(expected[2], 30);
  EXPECT_THAT(refusal([&] {
                on_vertices({none, 1, 2, 30, 4, 5, 60, 7, 8, 9, 30, 61, 12});
              }),
              HasSubstr("got 60.000000 at vertex 6 and 61.000000 at vertex 11, which are joined"));
  EXPECT_THAT(refusal([&] {
                on_vertices({none, 1, 2, 30, 4, 5, none, 7, 8, 9, 30, none, 12});
              }),
              HasSubstr("no value for vertex 6"));
  // What is not in the patch may say what it likes.
  const TriangleSurface part =
      surface_of(R"({"file": ")" + seam + R"(", "coincident": "join", "crop": {"vertices": [1, 2, 4, 5]}})");
  EXPECT_EQ(on_surface_vertices(part, {none, 1, 2, 30, 4, 5, 60, 7, 8, 9, 31, 61, 12}, "").size(), 4);
}

TEST(SceneSurface, RefusesMoreFacesThanCanBeCounted) {
  EXPECT_THAT(refusal([] { surface_of(R"({"grid": {"size": [100, 100], "cells": [8000, 5000]}})"); }),
              HasSubstr("/skin/surface/grid/cells: got 80000000 faces, expected at most 33554431"));
}

TEST(SceneSurface, ListsMayNameEitherOfTwoJoinedVertices) {
  const std::string seam =
      write("joined.obj", grid_obj(2, 50) + "v 100 0 0\nv 100 50 0\nv 150 0 0\nf 11 13 12\n");
  const std::string joined = R"({"file": ")" + seam + R"(", "coincident": "join")";
  // From 0, vertex 10 lies on 3 and 11 on 6.
  const auto crop = [&](const char* list) {
    return surface_of(joined + R"(, "crop": {"vertices": )" + list + "}}");
  };
  EXPECT_EQ(crop("[10, 12, 11]").source_vertex, (std::vector<int>{3, 6, 12}));
  EXPECT_EQ(crop("[10, 12, 11]").faces, crop("[3, 12, 6]").faces);
  EXPECT_EQ(crop("[2, 5, 3, 11]").source_vertex, crop("[2, 5, 3, 6]").source_vertex);
  // The last vertex of the file is a joined one and in the list all the same.
  const std::string last =
      write("last.obj", grid_obj(2, 50) + "v 150 0 0\nv 100 0 0\nv 100 50 0\nf 12 11 13\n");
  EXPECT_EQ(
      surface_of(R"({"file": ")" + last + R"(", "coincident": "join", "crop": {"vertices": [10, 11, 12]}})")
          .faces.size(),
      1u);

  const auto map = [&](int vertex) {
    const SceneModel model(
        parse_scene_text(R"({"skin": {"order": 1, "surface": )" + joined +
                             R"(}, "layers": [{"name": "soft", "thickness": 1, "youngs_modulus": 0.02}]},
            "ligaments": {"diffusion_time": 900, "sources": [{"name": "b", "strength": 5, "vertex": 7}, {"name": "a", "strength": 1, "vertex": )" +
                             std::to_string(vertex) + "}]}}",
                         "a.json"));
    return model.ligament_map(model.scene());
  };
  const VectorXd expected = map(3);
  EXPECT_EQ(map(10), expected);
  EXPECT_NE(map(1), expected);
}

}  // namespace
}  // namespace rhytid
