#include "sim/scene/parameter.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "scene_texts.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/rules.h"

namespace rhytid {
namespace {

Scene full() {
  return parse_scene_text(testing::full_scene, "a.json");
}

template <class F>
std::string error_of(F f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Parameter, DescribesByNameAndByNumber) {
  const Scene scene = full();
  for (const char* address : {"/skin/layers/film/youngs_modulus", "/skin/layers/1/youngs_modulus"}) {
    const ParameterSpec spec = describe_parameter(scene, address);
    EXPECT_EQ(spec.address, "/skin/layers/film/youngs_modulus");
    EXPECT_EQ(spec.name, "film youngs_modulus");
    EXPECT_EQ(spec.unit, "MPa");
    EXPECT_EQ(spec.transform, ParameterTransform::log);
    EXPECT_EQ(spec.value, 4);
  }
  EXPECT_EQ(describe_parameter(scene, "/ligaments/sources/jaw/strength").unit, "1/mm");
  EXPECT_EQ(describe_parameter(scene, "/ligaments/diffusion_time").unit, "mm²");
  EXPECT_EQ(describe_parameter(scene, "/ligaments/stiffness").name, "ligaments stiffness");
  EXPECT_EQ(describe_parameter(scene, "/colliders/finger/friction/coefficient").name,
            "finger friction coefficient");
  EXPECT_EQ(describe_parameter(scene, "/skin/layers/soft/poissons_ratio").transform,
            ParameterTransform::logit);
  const ParameterSpec knot = describe_parameter(scene, "/colliders/0/path/1/position/2");
  EXPECT_EQ(knot.address, "/colliders/finger/path/1/position/2");
  EXPECT_EQ(knot.name, "finger path 1 position z");
  EXPECT_EQ(knot.unit, "mm");
  EXPECT_EQ(knot.transform, ParameterTransform::none);
  EXPECT_EQ(knot.value, 7);
  EXPECT_EQ(knot.lower, 2);
  EXPECT_EQ(knot.upper, 12);
  EXPECT_EQ(describe_parameter(scene, "/ligaments/sources/cheek/position/2").value, 3);
}

// 2 layers x 5, ligaments 2 + 2 sources, base, finger 3, table 1 (a plane without friction has no radius);
// components of a source's position (the other one is at a vertex), of two knots and of one; the clock of what
// moves.
TEST(Parameter, ListsAllOfTheScene) {
  EXPECT_EQ(all_parameters(full()).size(), 2 * 5 + 2 + 2 + 1 + 3 + 1 + 3 * (1 + 2 + 1u) + 1);
  EXPECT_EQ(all_parameters(parse_scene_text(testing::minimal_scene, "m.json")).size(), 5u);
}

TEST(Parameter, BoundsLieInsideTheRulesAndAroundTheDefaults) {
  for (const ParameterSpec& spec : all_parameters(full())) {
    SCOPED_TRACE(spec.address);
    Scene scene = full();
    EXPECT_LT(spec.lower, spec.value);
    EXPECT_LT(spec.value, spec.upper);
    if (spec.transform == ParameterTransform::log) {
      EXPECT_GT(spec.lower, 0);
    }
    set_parameter(scene, spec.address, spec.lower);
    set_parameter(scene, spec.address, spec.upper);
  }
}

// Setting one parameter changes that value and nothing else, and its address is a --set address of the file.
TEST(Parameter, SetsOneValueAtItsAddressInTheFile) {
  const Scene before = full();
  for (const ParameterSpec& spec : all_parameters(before)) {
    SCOPED_TRACE(spec.address);
    Scene changed = before;
    const double value = 0.5 * (spec.value + spec.upper);
    set_parameter(changed, spec.address, value);
    EXPECT_EQ(get_parameter(changed, spec.address), value);
    const auto patch = nlohmann::json::diff(scene_to_json(before), scene_to_json(changed));
    ASSERT_EQ(patch.size(), 1u);
    EXPECT_EQ(get_parameter(changed, patch[0]["path"].get<std::string>()), value);
    char text[64];
    std::snprintf(text, sizeof(text), "%.17g", value);
    const Scene overridden = parse_scene_text(testing::full_scene, "a.json", {spec.address + "=" + text});
    EXPECT_EQ(scene_to_json(overridden), scene_to_json(changed));
  }
}

TEST(Parameter, RefusesUnknownAddressesAndValues) {
  Scene scene = full();
  EXPECT_EQ(error_of([&] { describe_parameter(scene, "/skin/layers/film/young_modulus"); }),
            "a.json: parameter address: got \"/skin/layers/film/young_modulus\", expected a fit-able scalar, "
            "nearest "
            "is /skin/layers/film/youngs_modulus; 'rhytid check SCENE --parameters' lists them");
  // Integers, what this scene does not have, and what is not fit-able.
  for (const char* address :
       {"", "/colliders/table/radius", "/colliders/table/friction/coefficient", "/skin/layers/2/stiffening",
        "/base/stiffness/x", "/ligaments/sources/jaw/position/0", "/colliders/finger/path/2/position/0",
        "/colliders/finger/path/1/position/3"})
    EXPECT_THAT(error_of([&] { get_parameter(scene, address); }), ::testing::HasSubstr("nearest is /"))
        << address;
  for (const char* address : {"/skin/order", "/skin/layers/soft/thickness", "/skin/layers/0/thickness"})
    EXPECT_THAT(
        error_of([&] { get_parameter(scene, address); }),
        ::testing::AllOf(::testing::HasSubstr("expected a scalar that can be fitted, which this one is not"),
                         ::testing::Not(::testing::HasSubstr("nearest"))))
        << address;
  EXPECT_EQ(error_of([&] { set_parameter(scene, "/skin/layers/soft/poissons_ratio", 0.5); }),
            "a.json: /skin/layers/soft/poissons_ratio: got 0.5, expected a number from 0 to 0.49999");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(set_parameter(scene, "/base/stiffness", nan), InputError);
  EXPECT_THROW(set_parameter(scene, "/base/stiffness", 0), InputError);
  EXPECT_EQ(scene_to_json(scene), scene_to_json(full()));
}

}  // namespace
}  // namespace rhytid
