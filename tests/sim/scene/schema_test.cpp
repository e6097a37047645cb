// The schema and the documentation say what the validator does: all three come from one table.
#include <gmock/gmock.h>

#include "scene_texts.h"
#include "schema_checker.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/nearest.h"
#include "sim/scene/rules.h"

namespace rhytid {
namespace {

using nlohmann::json;
using testing::full_scene;
using testing::minimal_scene;
using testing::satisfies;

json parse(const char* text) {
  return json::parse(text, nullptr, true, true);
}

bool schema_accepts(const json& value) {
  static const json schema = scene_schema();
  return satisfies(value, schema, schema);
}

bool validator_accepts(const json& value) {
  try {
    parse_scene(value, "a.json");
    return true;
  } catch (const InputError&) {
    return false;
  }
}

TEST(SceneSchema, AcceptsScenesAndTheirDefaults) {
  for (const char* text : {minimal_scene, full_scene}) {
    EXPECT_TRUE(schema_accepts(parse(text)));
    EXPECT_TRUE(schema_accepts(scene_with_defaults(parse(text))));
  }
}

TEST(SceneSchema, AcceptsPatchesOfAnotherScene) {
  EXPECT_TRUE(schema_accepts(parse(R"({"extends": "a.json"})")));
  EXPECT_TRUE(schema_accepts(parse(
      R"({"extends": "a.json", "base": null, "skin": {"layers": {"film": {"youngs_modulus": 3}, "fat": null}}})")));
  EXPECT_FALSE(schema_accepts(parse(R"({"extends": "a.json", "bas": null})")));
  EXPECT_FALSE(schema_accepts(
      parse(R"({"extends": "a.json", "skin": {"layers": {"film": {"youngs_modulus": -3}}}})")));
  EXPECT_FALSE(schema_accepts(parse(R"({"extends": 3})")));
}

/// Every value of the scene, replaced by each of a set of other values, and every key removed.
TEST(SceneSchema, RejectsWhatTheValidatorRejects) {
  const json scene = scene_with_defaults(parse(full_scene));
  ASSERT_TRUE(validator_accepts(scene));
  const json others =
      parse(R"([null, true, "", "x", "clamped", -1, 0, 0.5, 1, 3.5, 1e7, 1e300, [], [1], [1, 2, 3], {},
                                {"name": "x"}, "1 mm", "/"])");
  // Rules over several values (unique names, increasing times, directions, turns, the radius of a spherical base,
  // quadrature) and the dimension of a unit are beyond a schema.
  const auto is_beyond = [](const std::string& pointer, const json& value) {
    return value == "1 mm" || value == "x" || pointer.ends_with("/name") || pointer.ends_with("/time") ||
           pointer.find("/normal") != std::string::npos || pointer.find("/axis") != std::string::npos ||
           pointer.find("/rotation") != std::string::npos || pointer == "/base/radius" ||
           pointer.starts_with("/skin/quadrature/");
  };
  int rejected = 0, compared = 0;
  const json pointers = scene.flatten();
  std::vector<std::string> all;
  for (const auto& [leaf, value] : pointers.items())
    for (json::json_pointer p(leaf); !p.empty(); p.pop_back()) all.push_back(p.to_string());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  for (const std::string& pointer : all) {
    for (const json& other : others) {
      json changed = scene;
      changed[json::json_pointer(pointer)] = other;
      const bool is_valid = validator_accepts(changed), passes = schema_accepts(changed);
      rejected += !is_valid;
      ++compared;
      EXPECT_FALSE(is_valid && !passes) << pointer << " = " << other << " is valid but fails the schema";
      if (!is_beyond(pointer, other)) {
        EXPECT_EQ(is_valid, passes) << pointer << " = " << other;
      }
    }
    json removed = scene;
    json::json_pointer parent(pointer);
    const std::string key = parent.back();
    parent.pop_back();
    if (!removed[parent].is_object()) continue;
    removed[parent].erase(key);
    if (pointer != "/base/radius") {
      EXPECT_EQ(validator_accepts(removed), schema_accepts(removed)) << pointer;
    }
  }
  EXPECT_GT(rejected, compared / 2);
  EXPECT_GT(compared, 1500);
}

TEST(SceneSchema, PairsAndDependenciesAgree) {
  for (const char* surface : {
           R"({"file": "a.obj"})",
           R"({"file": "a.obj", "unit": "cm"})",
           R"({"file": "a.obj", "mm_per_unit": 10})",
           R"({"file": "a.obj", "unit": "cm", "mm_per_unit": 10})",
           R"({"unit": "cm"})",
           R"({})",
           R"({"file": "a.obj", "crop": {"centre": [0, 0, 0], "radius": 9}})",
           R"({"file": "a.obj", "crop": {"centre": [0, 0, 0]}})",
           R"({"file": "a.obj", "crop": {"box": {"low": [0, 0, 0], "high": [1, 2, 3]}}})",
           R"({"file": "a.obj", "crop": {"box": {"low": [0, 0, 0]}}})",
           R"({"file": "a.obj", "coincident": "join", "crop": {"vertices": [4, 8, 9]}})",
           R"({"file": "a.obj", "crop": {"vertices": [4, -8, 9]}})",
           R"({"file": "a.obj", "crop": {"vertices": [4, 8]}})",
           R"({"file": "a.obj", "crop": {"vertices_file": "list.txt"}})",
           R"({"grid": {"size": [1, 1], "cells": [1, 1]}, "crop": {"centre": [0, 0, 0], "radius": 9}})",
           R"({"grid": {"size": [1, 1], "cells": [1, 1]}, "file": "a.obj"})",
       }) {
    json scene = parse(minimal_scene);
    scene["skin"]["surface"] = parse(surface);
    EXPECT_EQ(validator_accepts(scene), schema_accepts(scene)) << surface;
  }
}

TEST(SceneRules, AreWellFormed) {
  std::set<std::string> seen;
  for (const Rule& rule : scene_rules()) {
    SCOPED_TRACE(rule.pointer);
    EXPECT_TRUE(seen.insert(rule.pointer).second) << "twice";
    EXPECT_FALSE(rule.doc.empty());
    EXPECT_TRUE(rule.pointer.empty() || seen.contains(rule.pointer.substr(0, rule.pointer.rfind('/'))))
        << "parents come first";
    EXPECT_EQ(rule.type == RuleType::option, !rule.options.empty());
    EXPECT_FALSE(rule.is_required && !rule.fallback.is_null());
    if (rule.type == RuleType::array) {
      EXPECT_NE(find_rule(rule.pointer + "/*"), nullptr);
    }
    if (rule.fallback.is_number()) {
      EXPECT_TRUE(is_in_range(rule, rule.fallback.get<double>()));
    }
    const std::string parent = rule.pointer.substr(0, rule.pointer.rfind('/'));
    if (!rule.rival.empty()) {
      EXPECT_NE(find_rule(parent + "/" + rule.rival), nullptr);
    }
    if (!rule.needs.empty()) {
      EXPECT_NE(find_rule(parent + "/" + rule.needs), nullptr);
    }
    if (rule.pointer.empty()) continue;
    EXPECT_THAT(scene_documentation(), ::testing::HasSubstr("| `" + rule.pointer + "` | "));
  }
}

TEST(Nearest, CountsEdits) {
  EXPECT_EQ(edit_distance("", "ab"), 4);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 6);  // three edits of two halves
  EXPECT_EQ(edit_distance("tiem", "time"), 2);       // one swap
  EXPECT_EQ(edit_distance("Order", "order"), 1);
  EXPECT_EQ(nearest_word("thicknes", {"name", "thickness", "order"}), "thickness");
  EXPECT_EQ(nearest_word("x", {}), "");
}

}  // namespace
}  // namespace rhytid
