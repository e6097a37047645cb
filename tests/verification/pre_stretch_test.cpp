// Skin under tension in its rest shape: frame 0 against the closed state of one material point, what stays at
// rest, and the gradient by the stretches.
#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <cstdio>

#include "sim/scene/load.h"
#include "sim/terms/material_point.h"
#include "tests/support/small_scenes.h"
#include "tests/verification/loaded_problem.h"

namespace rhytid {
namespace {

/// A flat slab whose rim slides: the tension is the same everywhere, only the thickness adjusts.
Scene tense_slab(double stretch) {
  Scene s = test::slab_scene(4, 2, 0.8, 1, 2, 2);
  s.skin.rim = RimCondition::sliding;
  s.skin.pre_stretch = PreStretchScene{stretch, std::nullopt, std::nullopt};
  s.time.frames = 3;
  // Ligaments hold the inner face at its height. Nothing pulls on them: in the plane nothing moves, and
  // across it there is no load.
  s.ligaments = LigamentScene{};
  SourceScene source;
  source.name = "all";
  s.ligaments->sources = {source};
  s.solver.relative_tolerance = 1e-12;
  return s;
}

double stored_energy(const SceneModel& m, const State& state) {
  // Equilibrium energy: a step of no length with the history at its end; the Maxwell spring is then part of
  // it.
  const StepInfo standstill{0, -1e-12, 0};
  StepProblem problem(m.model(), m.native(), standstill, state);
  double total = 0;
  for (const double e : problem.term_energies(state.u)) total += e;
  return total;
}

TEST(PreStretch, FrameZeroIsTheRelaxedMaterialPoint) {
  for (const double stretch : {1.05, 1.15, 1.3, 0.9}) {
    Scene scene = tense_slab(stretch);
    scene.skin.layers[0].poissons_ratio = 0.49;
    const SceneModel m(scene);
    const Trajectory run = simulate(m.model(), m.native(), m.run_options());
    ASSERT_TRUE(run.complete) << run.failure;
    ASSERT_EQ(run.frame_end[0], 1);

    // One material point, stretched equally in the plane, free through the thickness, held until it has
    // relaxed.
    SkinParameters p;
    MaterialProgram program =
        ramp_and_hold(Vec3(stretch, stretch, 1 / (stretch * stretch)).asDiagonal(), 0, 1e4, 100);
    program.traction_free[2] = true;
    const MaterialPointRun point = run_material_point(p, DamperScheme::exponential, program);
    ASSERT_TRUE(point.complete) << point.failure;
    const double volume = 4 * 4 * 0.8, expected = point.states.back().energy * volume;
    const double energy = stored_energy(m, run.at_frame(0));
    const double j = point.states.back().deformation.determinant();
    const double lowest = m.model().terms[0].smallest_jacobian(run.at_frame(0).u);
    std::printf(
        "stretch %g: energy %.12g mJ, material point %.12g, relative difference %.1e; J %.9g and %.9g\n",
        stretch, energy, expected, std::fabs(energy / expected - 1), lowest, j);
    EXPECT_NEAR(energy, expected, 1e-9 * expected);
    EXPECT_NEAR(lowest, j, 1e-9);
    // In the plane nothing moves; without loads nothing moves later.
    for (int node = 0; node < m.model().num_nodes(); ++node)
      EXPECT_LT(run.at_frame(0).u.segment<2>(3 * node).norm(), 1e-9);
    for (int frame = 1; frame <= 3; ++frame)
      EXPECT_LT((run.at_frame(frame).u - run.at_frame(0).u).lpNorm<Eigen::Infinity>(), 1e-8);
  }
}

TEST(PreStretch, AlongADirectionIsTheTwoStretchesOfThatFrame) {
  // λ₁ along a diagonal, λ₂ across: against C_p = F_pᵀ F_p of one affine point through the material point.
  Scene scene = tense_slab(1.2);
  scene.skin.rim = RimCondition::clamped;
  scene.skin.pre_stretch->across = 0.95;
  scene.skin.pre_stretch->direction = Vec3(1, 1, 0.3);  // the part along z is projected out
  const SceneModel m(scene);
  const State rest = m.model().rest_state();
  StepProblem problem(m.model(), m.native(), {0, -1e9, 0}, rest);
  const double energy = problem.term_energies(rest.u)[0];
  const double diagonal = std::sqrt(0.5);
  Mat3 turn;
  turn << diagonal, -diagonal, 0, diagonal, diagonal, 0, 0, 0, 1;
  const Mat3 f = turn * Vec3(1.2, 0.95, 1 / (1.2 * 0.95)).asDiagonal() * turn.transpose();
  const MaterialPointRun point =
      run_material_point({}, DamperScheme::exponential, ramp_and_hold(f, 0, 1e4, 100));
  ASSERT_TRUE(point.complete);
  const double expected = point.states.back().energy * 4 * 4 * 0.8;
  EXPECT_NEAR(energy, expected, 1e-8 * expected);
}

TEST(PreStretch, OneIsRestAndEveryDamperSettles) {
  for (const char* damper : {"exponential", "literal", "strang", "backward_euler", "none"}) {
    const std::string at = std::string("/time/damper=") + damper;
    const Scene calm =
        parse_scene_text(test::drag_scene(2, 1), "calm",
                         {"/skin/surface/grid/cells=[3,2]", "/skin/pre_stretch={\"stretch\":1}",
                          "/colliders/finger/friction=null", at});
    const SceneModel m(calm);
    RunOptions options = m.run_options();
    options.frames = 0;
    const Trajectory run = simulate(m.model(), m.native(), options);
    ASSERT_TRUE(run.complete) << run.failure;
    EXPECT_LT(run.at_frame(0).u.lpNorm<Eigen::Infinity>(), 1e-14);
    EXPECT_LT(run.at_frame(0).history.lpNorm<Eigen::Infinity>(), 1e-12);

    // Under tension: settled means that an idle step changes nothing.
    Scene tense = calm;
    tense.skin.pre_stretch->stretch = 1.1;
    for (PathKnot& knot : tense.colliders[0].path) knot.position.z() += 20;  // no finger
    const SceneModel t(tense);
    options.frames = 2;
    const Trajectory idle = simulate(t.model(), t.native(), options);
    ASSERT_TRUE(idle.complete) << idle.failure;
    EXPECT_GT(idle.at_frame(0).u.lpNorm<Eigen::Infinity>(), 1e-3) << "tension moved nothing";
    EXPECT_LT((idle.at_frame(2).u - idle.at_frame(0).u).lpNorm<Eigen::Infinity>(), 1e-6) << damper;
    EXPECT_EQ(idle.at_frame(0).time, 0);
    EXPECT_NEAR(idle.at_frame(2).time, 2. / 24, 1e-15);
  }
}

}  // namespace
}  // namespace rhytid
