// The IMLS bone under convex skin (T3, T4, T17): how far its zero lies from the rest surface,
// that this gap makes no force, and what it would do if it did.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/surface/implicit_shape.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

TEST(Bone, ZeroLoadGivesZeroDisplacementOnConvexBone) {
  const double bend = 30;
  for (const char* kernel : {"smooth", "literal"})
    for (const double support : {3.0, 5.0}) {
      Scene scene = parse_scene_text(
          test::drag_scene(3, 3), "bone.json",
          {R"(/base={"shape": "imls", "stiffness": "1 MPa/mm"})", std::string("/base/imls_kernel=") + kernel,
           "/base/imls_support=" + std::to_string(support), "/skin/surface/grid/cells=[8,6]"});
      scene.skin.surface.bend_radius = bend;
      scene.skin.rim = RimCondition::free;
      for (PathKnot& k : scene.colliders[0].path) k.position[2] += 20;  // the finger does not touch
      const SceneModel m(scene);
      const Trajectory run = simulate(m.model(), m.native(), m.run_options());
      ASSERT_TRUE(run.complete) << run.failure;
      EXPECT_EQ(run.at_frame(3).u.lpNorm<Eigen::Infinity>(), 0.0);
      // The gap of the middle of the patch; a cylinder bends one way only: half the gap of the sphere −c
      // h²/R.
      const SkinMesh& mesh = m.model().mesh;
      double gap = 0;
      for (int c = 0; c < mesh.num_columns; ++c) {
        const Vec3 x = mesh.rest.row(mesh.node(c, 0)).transpose();
        const GapJet jet = m.model().shapes[0]->evaluate(x);
        ASSERT_TRUE(jet.supported);
        if (jet.gap < gap) gap = jet.gap;
      }
      const double inner = bend - 1.65, moment = kernel[0] == 's' ? 1. / 12 : 3. / 56;
      std::printf(
          "IMLS of a bent inner face, %s kernel, h = %g mm: gap at rest down to %.4f mm (cylinder, dense "
          "points "
          "%.4f), %.0f kPa if it counted; displacement after 3 frames exactly 0\n",
          kernel, support, gap, -0.5 * moment * support * support / inner, -2 * gap * 1e3);
      EXPECT_LT(gap, -0.9 * 0.5 * moment * support * support / inner);
      EXPECT_GT(gap, -1.1 * 0.5 * moment * support * support / inner);
    }
}

}  // namespace
}  // namespace rhytid
