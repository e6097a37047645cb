// The last rung of the failure ladder: a step that fails directly converges through softened penalties, to
// the same equilibrium.
#include <gtest/gtest.h>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

/// The finger presses 0.5 mm in the first frame against stiff penalties.
SceneModel stiff_press() {
  Scene scene = parse_scene_text(test::drag_scene(1, 1), "drag.json", test::coarse());
  scene.base->stiffness = scene.colliders[0].stiffness = 1e3;
  scene.base->onset = scene.colliders[0].onset = 1e-4;
  scene.colliders[0].path = {{0, Vec3(-2, 0, 5.02)}, {1. / 24, Vec3(-2, 0, 4.5)}};
  return SceneModel(std::move(scene));
}

TEST(SoftenedStep, RescuesAStepAndLandsInTheSameEquilibrium) {
  const SceneModel m = stiff_press();
  RunOptions options = m.run_options();
  options.max_bisections = 0;
  options.minimiser.max_iterations = 2000;
  const Trajectory direct = simulate(m.model(), m.native(), options);
  ASSERT_TRUE(direct.complete) << direct.failure;
  ASSERT_FALSE(direct.steps[0].softened);
  const int needed = direct.steps[0].report.iterations;

  // Fewer iterations than the direct way needs; each soft step has as many again.
  options.minimiser.max_iterations = needed - 1;
  const Trajectory rescued = simulate(m.model(), m.native(), options);
  ASSERT_TRUE(rescued.complete) << rescued.failure;
  EXPECT_TRUE(rescued.steps[0].softened);
  EXPECT_LT(rescued.steps[0].report.iterations, needed);
  EXPECT_LT((rescued.at_frame(1).u - direct.at_frame(1).u).cwiseAbs().maxCoeff(),
            1e-6 * direct.at_frame(1).u.cwiseAbs().maxCoeff());
}

TEST(SoftenedStep, FailsClearlyWhenNothingHelps) {
  const SceneModel m = stiff_press();
  RunOptions options = m.run_options();
  options.max_bisections = 1;
  options.minimiser.max_iterations = 1;
  const Trajectory run = simulate(m.model(), m.native(), options);
  EXPECT_FALSE(run.complete);
  EXPECT_NE(run.failure.find("max_iterations"), std::string::npos) << run.failure;
  EXPECT_EQ(run.frames(), 0);
}

TEST(SoftenedStep, PenaltiesAreThoseOfBaseAndColliders) {
  const SceneModel m = stiff_press();
  const std::vector<int> penalties = m.model().penalties();
  ASSERT_EQ(penalties.size(), 2u);
  for (const int i : penalties) EXPECT_EQ(m.native()[i], 1e3);
}

}  // namespace
}  // namespace rhytid
