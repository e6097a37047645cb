// Numbers of a scene by address, parameters or not, and scenes with another value.
#include "sim/scene/scene_quantity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "tests/support/small_scenes.h"
#include "tests/support/temporary_folder.h"

namespace rhytid {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

Scene drag(const std::vector<std::string>& settings = {}) {
  return parse_scene_text(test::drag_scene(2, 2), "drag.json", settings);
}

TEST(SceneQuantity, DescribesByNameAndByNumber) {
  const Scene scene = drag();
  for (const char* address : {"/skin/layers/film/thickness", "/skin/layers/1/thickness"}) {
    const SceneQuantity q = describe_quantity(scene, address);
    EXPECT_EQ(q.address, "/skin/layers/film/thickness");
    EXPECT_EQ(q.name, "film thickness");
    EXPECT_EQ(q.dimension, dimension::length);
    EXPECT_EQ(q.value, scene.skin.layers[1].thickness);
  }
  Scene of_one = scene;
  of_one.skin.layers[0].name = "skin";
  EXPECT_EQ(describe_quantity(of_one, "/skin/layers/skin/thickness").name, "skin thickness");
  EXPECT_EQ(describe_quantity(scene, "/ligaments/sources/right/radius").name, "ligaments right radius");
  EXPECT_EQ(describe_quantity(scene, "/colliders/finger/onset").value, scene.colliders[0].onset);
  EXPECT_EQ(describe_quantity(scene, "/colliders/finger/path/0/position/2").value,
            scene.colliders[0].path[0].position[2]);
  EXPECT_EQ(describe_quantity(scene, "/ligaments/sources/right/radius").value,
            scene.ligaments->sources[1].radius);
}

TEST(SceneQuantity, ChangesNothingElse) {
  const Scene scene = drag();
  const Scene moved = with_quantity(scene, "/skin/layers/film/thickness", 0.7);
  EXPECT_EQ(moved.skin.layers[1].thickness, 0.7);
  EXPECT_EQ(moved.file, scene.file);
  Scene back = moved;
  back.skin.layers[1].thickness = scene.skin.layers[1].thickness;
  EXPECT_EQ(scene_to_json(back), scene_to_json(scene));
  EXPECT_EQ(scene_to_json(with_quantity(scene, "/base/onset", 0.01))["base"]["onset"], 0.01);
}

TEST(SceneQuantity, ScalesAThicknessMap) {
  const test::TemporaryFolder folder;
  const std::string file = folder / "thickness.json";
  std::ofstream(file) << "[1, 1.5, 2, 1.5]";
  Scene scene = drag();
  scene.skin.layers[0].thickness_map = file;
  scene.skin.layers[0].thickness_by_vertex = {1, 1.5, 2, 1.5};
  scene.skin.layers[0].thickness = 1.5;
  const Scene moved = with_quantity(scene, "/skin/layers/soft/thickness", 1.65);
  EXPECT_EQ(moved.skin.layers[0].thickness, 1.65);
  ASSERT_EQ(moved.skin.layers[0].thickness_by_vertex.size(), 4u);
  for (std::size_t v = 0; v < 4; ++v)
    EXPECT_NEAR(moved.skin.layers[0].thickness_by_vertex[v],
                1.1 * scene.skin.layers[0].thickness_by_vertex[v], 1e-12);
  // Another number of the scaled scene leaves the scaled map.
  const Scene both = with_quantity(moved, "/base/onset", 0.01);
  EXPECT_EQ(both.skin.layers[0].thickness_by_vertex, moved.skin.layers[0].thickness_by_vertex);
  EXPECT_EQ(both.skin.layers[0].thickness, 1.65);
}

TEST(SceneQuantity, RefusesWhatIsNone) {
  const Scene scene = drag();
  EXPECT_THAT(
      [&] { describe_quantity(scene, "/skin/layers/film/thicknes"); },
      ThrowsMessage<InputError>(AllOf(HasSubstr("drag.json: address: got \"/skin/layers/film/thicknes\""),
                                      HasSubstr("nearest is /skin/layers/film/thickness"))));
  EXPECT_THROW(describe_quantity(scene, "/skin/layers/film/order"), InputError) << "an integer";
  EXPECT_THROW(describe_quantity(scene, "/skin/layers/film/name"), InputError);
  EXPECT_THAT([&] { with_quantity(scene, "/skin/layers/film/thickness", -1); },
              ThrowsMessage<InputError>(
                  AllOf(HasSubstr("/skin/layers/film/thickness: got -1"), HasSubstr("> 0 mm"))));
}

}  // namespace
}  // namespace rhytid
