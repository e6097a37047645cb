// The heat maps that a scene's ligaments keep: few, the same bits, and safe from several threads.
#include "sim/scene/parts/ligament_part.h"

#include <gtest/gtest.h>

#include <thread>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

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
  const LigamentPart& part = *model.ligaments();
  const auto first = part.heat(3);
  EXPECT_EQ(part.heat(3), first) << "asked again at once: kept";
  for (int i = 0; i < 20; ++i) {
    (void)part.heat(4 + i);
    if (i < 3) {
      EXPECT_EQ(part.heat(3), first) << "used in between: kept";
    }
  }
  const auto again = part.heat(3);
  EXPECT_NE(again, first) << "forgotten, but alive for its holder";
  EXPECT_EQ(again->weights, first->weights);
  EXPECT_EQ(again->d_weights_d_time, first->d_weights_d_time);
}

TEST(LigamentPart, SeveralThreadsMayAsk) {
  const SceneModel model = small_model();
  const LigamentPart& part = *model.ligaments();
  std::vector<std::thread> threads;
  std::vector<double> sums(4, 0);
  for (std::size_t t = 0; t < sums.size(); ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 30; ++i) sums[t] += part.heat(2 + (i + 3 * static_cast<int>(t)) % 6)->weights(0, 0);
    });
  for (std::thread& thread : threads) thread.join();
  for (double sum : sums) EXPECT_NEAR(sum, sums[0], 1e-12);
}

}  // namespace
}  // namespace rhytid
