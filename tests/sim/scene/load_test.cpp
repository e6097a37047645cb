#include "sim/scene/load.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "scene_texts.h"
#include "sim/core/error.h"

namespace rhytid {
namespace {

using nlohmann::json;
using testing::full_scene;
using testing::minimal_scene;

TEST(LoadScene, DefaultsAreThoseOfTheStructs) {
  const Scene scene = parse_scene_text(minimal_scene, "minimal.json");
  EXPECT_EQ(scene.file, "minimal.json");
  EXPECT_FALSE(scene.ligaments || scene.base);
  Scene expected;
  expected.file = "minimal.json";
  expected.skin.surface.grid_size = {20, 10};
  expected.skin.surface.grid_cells = {4, 2};
  expected.skin.layers.resize(1);
  expected.skin.layers[0].name = "soft";
  expected.skin.layers[0].thickness = 2;
  expected.skin.layers[0].youngs_modulus = 0.02;
  EXPECT_EQ(scene_to_json(scene), scene_to_json(expected));
}

TEST(LoadScene, ReadsEveryPartInInternalUnits) {
  const Scene scene = parse_scene_text(full_scene, "full.json");
  EXPECT_EQ(scene.name, "drag");
  EXPECT_EQ(scene.skin.surface.grid_size, (std::array<double, 2>{20, 10}));
  EXPECT_EQ(scene.skin.surface.grid_cells, (std::array<int, 2>{8, 4}));
  EXPECT_EQ(scene.skin.surface.grid_pattern, "diagonal_plus");
  EXPECT_EQ(scene.skin.surface.bend_radius, 80);
  EXPECT_FALSE(scene.skin.surface.is_outer);
  EXPECT_EQ(scene.skin.surface.normal_smoothing, 1);
  EXPECT_EQ(scene.skin.order, 4);
  EXPECT_EQ(scene.skin.triangle_degree, 8);
  EXPECT_EQ(scene.skin.thickness_points, 3);
  EXPECT_EQ(scene.skin.contact_degree, 12);
  EXPECT_EQ(scene.skin.rim, RimCondition::sliding);
  ASSERT_EQ(scene.skin.layers.size(), 2u);
  EXPECT_EQ(scene.skin.layers[0].order, 3);
  EXPECT_EQ(scene.skin.layers[0].youngs_modulus, 0.02);
  EXPECT_EQ(scene.skin.layers[0].poissons_ratio, 0.45);
  EXPECT_EQ(scene.skin.layers[1].thickness, 0.05);
  EXPECT_EQ(scene.skin.layers[1].stiffening, 0.5);
  EXPECT_EQ(scene.skin.layers[1].relaxing_fraction, 0.8);
  EXPECT_EQ(scene.skin.layers[1].relaxation_time, 0.1);
  ASSERT_TRUE(scene.ligaments.has_value());
  EXPECT_EQ(scene.ligaments->stiffness, 5e-4);
  EXPECT_EQ(scene.ligaments->smoothing, 0.01);
  ASSERT_EQ(scene.ligaments->sources.size(), 2u);
  EXPECT_EQ(scene.ligaments->sources[0].position, Vec3(1, 2, 3));
  EXPECT_FALSE(scene.ligaments->sources[0].vertex.has_value());
  EXPECT_EQ(scene.ligaments->sources[0].strength, 0.8);
  EXPECT_EQ(scene.ligaments->sources[1].vertex, 7);
  ASSERT_TRUE(scene.base.has_value());
  EXPECT_EQ(scene.base->shape, ShapeKind::sphere);
  EXPECT_EQ(scene.base->radius, 50);
  EXPECT_EQ(scene.base->stiffness, 2);
  ASSERT_EQ(scene.colliders.size(), 2u);
  ASSERT_TRUE(scene.colliders[0].friction.has_value());
  EXPECT_EQ(scene.colliders[0].friction->coefficient, 0.7);
  EXPECT_EQ(scene.colliders[0].friction->slip_speed, 5);
  EXPECT_EQ(scene.colliders[0].friction->mollifier, "quadratic");
  ASSERT_EQ(scene.colliders[0].path.size(), 2u);
  EXPECT_EQ(scene.colliders[0].path[1].time, 0.5);
  EXPECT_EQ(scene.colliders[0].path[1].position, Vec3(0, 0, 7));
  EXPECT_EQ(scene.colliders[1].shape, ShapeKind::plane);
  EXPECT_FALSE(scene.colliders[1].friction.has_value());
  EXPECT_EQ(scene.time.frame_rate, 24);
  EXPECT_EQ(scene.time.damper, DamperScheme::strang);
  EXPECT_EQ(scene.solver.minimiser, "lbfgs");
  EXPECT_EQ(scene.solver.absolute_tolerance, 1e-6);
  EXPECT_FALSE(scene.output.vtu);
  EXPECT_EQ(scene.output.every, 2);
}

TEST(LoadScene, LiteralLbfgsHasThePublishedValuesOfWhatIsNotGiven) {
  const auto solver_of = [](const std::vector<std::string>& settings) {
    return parse_scene_text(minimal_scene, "a.json", settings).solver;
  };
  const SolverScene literal = solver_of({"/solver/minimiser=lbfgs_literal"});
  EXPECT_EQ(literal.lbfgs_memory, 10);
  EXPECT_EQ(literal.lbfgs_refresh, 50);
  EXPECT_EQ(literal.relative_tolerance, 0);
  EXPECT_EQ(literal.absolute_tolerance, 1e-6);
  EXPECT_EQ(literal.max_iterations, SolverScene().max_iterations);
  const SolverScene given = solver_of(
      {"/solver/minimiser=lbfgs_literal", "/solver/relative_tolerance=1e-9", "/solver/lbfgs_memory=7"});
  EXPECT_EQ(given.relative_tolerance, 1e-9);
  EXPECT_EQ(given.lbfgs_memory, 7);
  EXPECT_EQ(given.lbfgs_refresh, 50);
  EXPECT_EQ(solver_of({"/solver/minimiser=lbfgs"}).lbfgs_refresh, 20);

  const Scene scene = parse_scene_text(minimal_scene, "a.json", {"/solver/minimiser=lbfgs_literal"});
  const json written = scene_to_json(scene);
  EXPECT_EQ(scene_to_json(parse_scene(written, "a.json")), written);
  EXPECT_EQ(scene_with_defaults(
                {{"skin", written["skin"]}, {"solver", {{"minimiser", "lbfgs_literal"}}}})["solver"],
            written["solver"]);
}

TEST(LoadScene, RoundTrips) {
  for (const char* text : {minimal_scene, full_scene}) {
    const json written = scene_to_json(parse_scene_text(text, "a.json"));
    EXPECT_EQ(scene_to_json(parse_scene(written, "a.json")), written);
    const json complete = scene_with_defaults(json::parse(text, nullptr, true, true));
    EXPECT_EQ(scene_with_defaults(complete), complete);
    EXPECT_EQ(scene_to_json(parse_scene(complete, "a.json")), written);
    EXPECT_EQ(complete.dump(), written.dump()) << "every key of the format is written back";
  }
}

TEST(LoadScene, RoundTripsAMeshFile) {
  const char* text = R"({"skin": {
    "surface": {"file": "/a/face.obj", "unit": "in", "crop": {"centre": [1, 2, "3 cm"], "radius": "4 cm"}},
    "layers": [{"name": "soft", "thickness": 2, "youngs_modulus": 0.02}]}})";
  const Scene scene = parse_scene_text(text, "a.json");
  EXPECT_EQ(scene.skin.surface.mm_per_unit, 25.4);
  EXPECT_EQ(scene.skin.surface.crop_centre, Vec3(1, 2, 30));
  EXPECT_EQ(scene.skin.surface.crop_radius, 40);
  const json written = scene_to_json(scene);
  EXPECT_EQ(written["skin"]["surface"]["mm_per_unit"], 25.4);
  EXPECT_EQ(scene_to_json(parse_scene(written, "a.json")), written);
}

class LoadFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("scene_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::create_directories(folder_ / "base");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path) << text;
    return path;
  }
  static std::string error_of(const std::string& path, const std::vector<std::string>& overrides = {}) {
    try {
      load_scene(path, overrides);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
};

TEST_F(LoadFiles, ExtendsMergesAndResolvesPaths) {
  write("base/base.json", R"({"skin": {
    "surface": {"file": "face.obj", "unit": "cm"},
    "layers": [{"name": "deep", "thickness": 3, "youngs_modulus": 0.01},
               {"name": "soft", "thickness": 2, "youngs_modulus": 0.02},
               {"name": "film", "thickness": 0.05, "youngs_modulus": 4}]},
    "base": {}, "time": {"frames": 5, "substeps": 2}})");
  const std::string path = write("scene.json", R"({"extends": "base/base.json",
    "skin": {"layers": {"film": {"youngs_modulus": "8 MPa"}, "deep": null}},
    "base": null, "time": {"frames": 7}})");
  const Scene scene = load_scene(path);
  EXPECT_EQ(scene.skin.surface.file, (folder_ / "base" / "face.obj").string());
  EXPECT_EQ(scene.skin.surface.mm_per_unit, 10);
  ASSERT_EQ(scene.skin.layers.size(), 2u);
  EXPECT_EQ(scene.skin.layers[0].name, "soft");
  EXPECT_EQ(scene.skin.layers[1].youngs_modulus, 8);
  EXPECT_EQ(scene.skin.layers[1].thickness, 0.05);
  EXPECT_FALSE(scene.base.has_value());
  EXPECT_EQ(scene.time.frames, 7);
  EXPECT_EQ(scene.time.substeps, 2);
  EXPECT_FALSE(load_scene_json(path).contains("extends"));
  EXPECT_FALSE(load_scene_json(path)["time"].contains("damper"));  // before defaults
}

// Messages name the file and line that wrote the value, not the file that was opened.
TEST_F(LoadFiles, ErrorsNameTheFileAndLineThatWroteTheValue) {
  const std::string base = write("base/base.json", minimal_scene);
  const std::string good = write("good.json", R"({"extends": "base/base.json", "skin": {"order": 2}})");
  EXPECT_EQ(error_of(good), "no error");
  write("base/base.json",
        std::string(minimal_scene).replace(std::string(minimal_scene).find("0.02"), 4, "-1"));
  EXPECT_EQ(error_of(good),
            (folder_ / "base/base.json").string() +
                ":4: /skin/layers/soft/youngs_modulus: got -1, expected a pressure > 0 MPa, e.g. "
                "\"20 kPa\"");
  write("base/base.json", minimal_scene);
  const std::string bad =
      write("bad.json", "{\"extends\": \"base/base.json\",\n\"skin\": {\n\"order\": 2.5}}");
  EXPECT_EQ(error_of(bad), bad + ":3: /skin/order: got 2.5, expected an integer from 1 to 4");
  EXPECT_EQ(error_of(good, {"/skin/order=9"}),
            good + " (--set): /skin/order: got 9, expected an integer from 1 to 4");
}

// Removing an item moves the ones behind it up; their lines must move with them.
TEST_F(LoadFiles, ListsOfNamedItemsArePatchedByName) {
  const std::string base =
      write("base.json", R"({"skin": {"surface": {"grid": {"size": [1, 1], "cells": [1, 1]}},
    "layers": [{"name": "a", "thickness": 1, "youngs_modulus": 1},
               {"name": "b", "thickness": 1,
                "youngs_modulus": -1},
               {"name": "c", "thickness": 1, "youngs_modulus": 1}]}})");
  const auto with_layers = [this](const std::string& layers) {
    return write("scene.json", R"({"extends": "base.json",
      "skin": {"layers": )" + layers +
                                   "}}");
  };
  EXPECT_THAT(error_of(with_layers(R"({"a": null})")),
              ::testing::StartsWith(base + ":4: /skin/layers/b/youngs_mod"));
  const std::string path = with_layers(
      R"({"a": null, "b": {"youngs_modulus": "2 MPa"}, "d": {"thickness": 3, "youngs_modulus": 4}})");
  const Scene scene = load_scene(path);
  ASSERT_EQ(scene.skin.layers.size(), 3u);
  EXPECT_EQ(scene.skin.layers[0].youngs_modulus, 2);
  EXPECT_EQ(scene.skin.layers[1].name, "c");
  EXPECT_EQ(scene.skin.layers[2].name, "d");
  // An appended item that was meant to be another one lacks what is required.
  EXPECT_THAT(error_of(with_layers(R"({"bb": {"youngs_modulus": 2}, "b": null})")),
              ::testing::StartsWith(path + ":2: /skin/layers/bb: got neither \"thickness\""));
  // A list replaces the whole list.
  EXPECT_EQ(
      load_scene(with_layers(R"([{"name": "e", "thickness": 1, "youngs_modulus": 1}])")).skin.layers.size(),
      1u);
  EXPECT_THAT(error_of(with_layers(R"([{"name": "b", "youngs_modulus": 1}])")),
              ::testing::HasSubstr("/skin/layers/b: got neither \"thickness\""));
}

TEST_F(LoadFiles, RefusesCyclesAndMissingFiles) {
  const std::string a = write("a.json", R"({"extends": "b.json"})");
  write("b.json", R"({"extends": "base/../a.json"})");
  EXPECT_THAT(error_of(a), ::testing::HasSubstr("b.json:1: /extends: got"));
  EXPECT_THAT(error_of(a), ::testing::HasSubstr("extends this file again"));
  const std::string c = write("c.json", R"({"extends": "nowhere.json"})");
  EXPECT_EQ(error_of(c), c + ":1: /extends: got " + (folder_ / "nowhere.json").string() +
                             ", which does not exist, expected a readable scene file");
  EXPECT_THAT(error_of((folder_ / "base").string()), ::testing::HasSubstr("expected a scene file"));
  EXPECT_THAT(error_of(write("d.json", R"({"extends": 3})")),
              ::testing::HasSubstr("d.json:1: /extends: got 3"));
}

TEST_F(LoadFiles, Overrides) {
  const std::string path = write("full.json", full_scene);
  const Scene scene = load_scene(
      path, {"/skin/layers/film/youngs_modulus=8 MPa", "/skin/layers/0/thickness=3", "/base=null",
             "/colliders/finger/path/1/position/2=6.5", "/colliders/table/friction={\"coefficient\": 0.1}",
             "/skin/rim=free", "/output/every=5", "/name=\"4\""});
  EXPECT_EQ(scene.skin.layers[1].youngs_modulus, 8);
  EXPECT_EQ(scene.skin.layers[0].thickness, 3);
  EXPECT_FALSE(scene.base.has_value());
  EXPECT_EQ(scene.colliders[0].path[1].position.z(), 6.5);
  ASSERT_TRUE(scene.colliders[1].friction.has_value());
  EXPECT_EQ(scene.colliders[1].friction->coefficient, 0.1);
  EXPECT_EQ(scene.skin.rim, RimCondition::free);
  EXPECT_EQ(scene.output.every, 5);
  EXPECT_EQ(scene.name, "4");

  EXPECT_THAT(error_of(path, {"/skin/layers/flim/thickness=1"}), ::testing::HasSubstr("nearest is \"film\""));
  EXPECT_THAT(error_of(path, {"/skin/layers/7/thickness=1"}),
              ::testing::HasSubstr("expected an item below 2"));
  EXPECT_THAT(error_of(path, {"/skin/ordr=1"}), ::testing::HasSubstr("nearest is \"order\""));
  EXPECT_THAT(error_of(path, {"skin/order=1"}), ::testing::HasSubstr("expected a JSON pointer"));
  EXPECT_THAT(error_of(path, {"/skin/order"}), ::testing::HasSubstr("expected pointer=value"));
  EXPECT_THAT(error_of(path, {"/skin/order/x=1"}),
              ::testing::HasSubstr("expected an object or a list there"));
  EXPECT_THAT(error_of(path, {"/extends=a.json"}), ::testing::HasSubstr("got /extends"));
}

}  // namespace
}  // namespace rhytid
