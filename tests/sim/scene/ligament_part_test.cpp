// The heat maps that a scene's ligaments keep: few, the same bits, and safe from several threads.
#include "sim/scene/parts/ligament_part.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "sim/scene/load.h"
#include "sim/scene/parameter.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

/// The map of a model at another diffusion time.
std::shared_ptr<const HeatMapWeights> heat_at(const SceneModel& model, double time) {
  Scene scene = model.scene();
  scene.ligaments->diffusion_time = time;
  return model.ligaments()->heat(scene);
}

SceneModel small_model() {
  return SceneModel(parse_scene_text(test::drag_scene(1, 1), "drag.json", test::coarse()));
}

TEST(LigamentPart, AFitOfTheDiffusionTimeKeepsFewMaps) {
  const SceneModel model = small_model();
  Scene scene = model.scene();
  for (int i = 0; i < 40; ++i) {
    scene.ligaments->diffusion_time = 5 + 0.1 * i;
    (void)model.native(scene);
    (void)model.native_derivative(scene, "/ligaments/diffusion_time");
  }
  EXPECT_EQ(model.ligaments()->heat_maps_kept(), LigamentPart::kHeatMapsKept);
}

TEST(LigamentPart, TheLastMapsAreKeptAndAForgottenOneComesBackWithTheSameBits) {
  const SceneModel model = small_model();
  const auto first = heat_at(model, 3);
  EXPECT_EQ(heat_at(model, 3), first) << "asked again at once: kept";
  for (int i = 0; i < 20; ++i) {
    (void)heat_at(model, 4 + i);
    if (i < 3) {
      EXPECT_EQ(heat_at(model, 3), first) << "used in between: kept";
    }
  }
  const auto again = heat_at(model, 3);
  EXPECT_NE(again, first) << "forgotten, but alive for its holder";
  EXPECT_EQ(again->weights, first->weights);
  EXPECT_EQ(again->d_weights_d_time, first->d_weights_d_time);
}

// ∂b/∂position of every node, along and across the surface, against central differences of the map.
TEST(LigamentPart, MapFollowsItsSources) {
  for (const char* bend : {"0", "30"}) {
    SCOPED_TRACE(bend);
    const bool is_flat = std::string(bend) == "0";
    const std::vector<std::string> settings{"/skin/surface/grid/cells=[7,6]",
                                            std::string("/skin/surface/grid/bend_radius=") + bend};
    Scene scene = parse_scene_text(test::drag_scene(2, 1), "drag.json", settings);
    // Above the middle of a face: above an edge of a bent surface it would stay on the edge.
    const Vec3 on_surface = SceneModel(scene).source_positions()[0];
    scene.ligaments->sources[0].position = on_surface + Vec3(0.4, 0.2, 0.05);
    const SceneModel model(scene);
    const NativeBlock& b = model.model().native_block("ligaments/b");
    for (int axis = 0; axis < 3; ++axis) {
      const std::string address = "/ligaments/sources/left/position/" + std::to_string(axis);
      const VectorXd exact = model.native_derivative(scene, address);
      double errors[2];
      for (const int k : {0, 1}) {
        const double h = 0.02 / (1 + k), at = get_parameter(scene, address);
        Scene more = scene, less = scene;
        set_parameter(more, address, at + h);
        set_parameter(less, address, at - h);
        errors[k] = ((model.native(more) - model.native(less)) / (2 * h) - exact).norm();
      }
      if (axis == 2 && is_flat) {
        EXPECT_EQ(exact.norm(), 0);
        EXPECT_LT(errors[1], 1e-12);
        continue;
      }
      EXPECT_GT(exact.segment(b.offset, b.size).norm(), axis < 2 ? 0.1 : 0.005);
      EXPECT_LT(errors[1], 1e-4 * exact.norm());
      EXPECT_NEAR(std::log2(errors[0] / errors[1]), 2, 0.1) << "axis " << axis;
    }
  }
}

TEST(LigamentPart, SeveralThreadsMayAsk) {
  const SceneModel model = small_model();
  std::vector<std::thread> threads;
  std::vector<double> sums(4, 0);
  for (std::size_t t = 0; t < sums.size(); ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 30; ++i)
        sums[t] += heat_at(model, 2 + (i + 3 * static_cast<int>(t)) % 6)->weights(0, 0);
    });
  for (std::thread& thread : threads) thread.join();
  for (double sum : sums) EXPECT_NEAR(sum, sums[0], 1e-12);
}

}  // namespace
}  // namespace rhytid
