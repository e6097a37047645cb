// /time/offset: the clock of paths runs ahead of the frames. The same as earlier knots; its derivative that of
// the simulation, by tangent and adjoint; what happens at kinks of paths.
#include <gtest/gtest.h>

#include "tests/adjoint/gradient_checks.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

const std::vector<std::string> kCoarse = {"/skin/surface/grid/cells=[3,2]", "/skin/layers/soft/order=1"};

std::vector<std::string> settings(std::vector<std::string> more) {
  more.insert(more.begin(), kCoarse.begin(), kCoarse.end());
  return more;
}

Trajectory run_of(const Scene& scene) {
  const SceneModel built(scene);
  return simulate(built.model(), built.native(), built.run_options());
}

const std::string kTurning = "/colliders/finger/path/2/rotation=[0.1,0.6,0.4]";
/// A side of the rim that rests until 0.1 s and is moved while the finger drags.
const std::string kHeld =
    R"(/skin/held=[{"name":"side","box":{"low":[-8,-6,0],"high":[-8,6,0]},"path":[)"
    R"({"time":0.1,"displacement":[0,0,0]},{"time":0.5,"displacement":[0.8,0.3,0.1]}]}])";

// A clock that runs ahead by s reads a path as one whose knots are earlier by s.
TEST(TimeOffset, IsTheSameAsEarlierKnots) {
  for (const std::string interpolation : {"linear", "spline", "clamped_spline"}) {
    Scene ahead = parse_scene_text(test::drag_scene(2, 5), "test.json",
                                   settings({"/colliders/finger/interpolation=" + interpolation, kTurning,
                                             kHeld, "/time/offset=0.03 s"}));
    Scene earlier = ahead;
    earlier.time.offset = 0;
    for (PathKnot& knot : earlier.colliders[0].path) knot.time -= ahead.time.offset;
    for (HeldKnot& knot : earlier.skin.held[0].path) knot.time -= ahead.time.offset;
    const Trajectory a = run_of(ahead), b = run_of(earlier);
    ahead.time.offset = 0;
    const Trajectory without = run_of(ahead);
    ASSERT_TRUE(a.complete && b.complete && without.complete);
    EXPECT_EQ(a.at_frame(0).u.cwiseAbs().maxCoeff(), 0);  // the skin does not settle
    for (int f = 1; f <= 5; ++f) {
      const double size = b.at_frame(f).u.cwiseAbs().maxCoeff();
      EXPECT_LT((a.at_frame(f).u - b.at_frame(f).u).cwiseAbs().maxCoeff(), 1e-12 * size)
          << interpolation << f;
      EXPECT_GT((a.at_frame(f).u - without.at_frame(f).u).cwiseAbs().maxCoeff(), 1e-2 * size) << f;
    }
  }
}

// At zero nothing is asked of it, and its derivative is there all the same.
TEST(TimeOffset, GradientIsRightAlsoAtZero) {
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"/colliders/finger/interpolation=spline", kTurning},
        {"/colliders/finger/path/0/time=-0.1", "/colliders/finger/path/1/time=0.14", kTurning,
         "/time/lag_passes=2"},
        {"/colliders/finger/path/1/time=0.14", kHeld, "/skin/held/0/path/0/time=0.07",
         "/skin/held/0/path/1/time=0.51"},
        // Every pass has its own share of moved nodes.
        {"/colliders/finger/path/0/time=-0.1", "/colliders/finger/path/1/time=0.14", kHeld,
         "/skin/held/0/path/0/time=0.07", "/skin/held/0/path/1/time=0.51", "/time/lag_passes=2"},
        // Skin that settles against a finger and a side that move already.
        {"/colliders/finger/path/0/time=-0.1", "/colliders/finger/path/1/time=0.14", kHeld,
         "/skin/held/0/path/0/time=-0.1", "/skin/held/0/path/1/time=0.51"}}) {
    const CertifiedCase c(test::drag_scene(2, 5), settings(more));
    ASSERT_TRUE(c.run.complete) << c.run.failure;
    const auto& output = *c.output;
    const ParameterSpace space(c.scene_model, {"/time/offset"});
    const AdjointResult adjoint = adjoint_sweep(c.model(), c.scene_model.native(), c.run, output, c.weights);
    const VectorXd gradient = space.jacobian().transpose() * adjoint.native_bar;
    EXPECT_NE(gradient[0], 0);
    EXPECT_LT(duality(c, output, c.weights, space.jacobian(), adjoint), 1e-12);
    const FunctionalDifference functional(c.scene_model, c.run, output, c.weights, certificate_minimiser({}));
    const VectorXd one = VectorXd::Ones(1);
    const TaylorSeries s =
        taylor_test(functional, space, one, gradient, measure_noise(functional, space, one), {});
    EXPECT_TRUE(s.passed) << s.sentence;
    EXPECT_LT(s.first_order_error, 1e-6);
  }
}

// Where a step ends at a kink the derivative is the mean of those of both sides, and the certificate says so.
TEST(TimeOffset, AtAKinkTheMeanOfBothSides) {
  const auto slope = [](const std::string& offset) {
    const CertifiedCase c(test::drag_scene(2, 4), settings({"/time/offset=" + offset}));
    const AdjointResult adjoint =
        adjoint_sweep(c.model(), c.scene_model.native(), c.run, *c.output, c.weights);
    return adjoint.native_bar[c.model().clock];
  };
  const double before = slope("-1e-7"), at = slope("0"), after = slope("1e-7");
  EXPECT_GT(std::fabs(before - after), 0.05 * std::fabs(at));
  EXPECT_NEAR(at, 0.5 * (before + after), 1e-4 * std::fabs(at));

  // The finger turns at frame 3.
  const CertifiedCase kink(test::drag_scene(2, 3), settings({})),
      smooth(test::drag_scene(2, 2), settings({})),
      passes(test::drag_scene(2, 2), settings({"/time/lag_passes=2"}));
  EXPECT_FALSE(kink.scene_model.is_smooth_in("/time/offset", kink.run));
  EXPECT_TRUE(kink.scene_model.is_smooth_in("/ligaments/stiffness", kink.run));
  EXPECT_TRUE(smooth.scene_model.is_smooth_in("/time/offset", smooth.run));
  // It starts to move where the first step starts, and slips in its second pass.
  EXPECT_FALSE(passes.scene_model.is_smooth_in("/time/offset", passes.run));
}

// Also when it is asked for: a right gradient is not called wrong.
TEST(TimeOffset, IsNotTestedAtAKinkWhenAskedFor) {
  const CertifiedCase kink(test::drag_scene(2, 3), settings({}));
  CertificateOptions options;
  options.addresses = {"/time/offset", "/ligaments/stiffness"};
  const CertificateReport report = certify(kink.scene_model, kink.run, *kink.output, kink.weights, options);
  EXPECT_TRUE(report.passed());
  EXPECT_EQ(report.not_smooth, std::vector<std::string>{"/time/offset"});
  EXPECT_EQ(report.parameters.size(), 1);
}

TEST(TimeOffset, IsAParameterOfScenesThatMove) {
  const Scene scene = parse_scene_text(test::drag_scene(2, 4), "test.json", settings({"/time/offset=0.1"}));
  const ParameterSpec spec = describe_parameter(scene, "/time/offset");
  EXPECT_EQ(spec.name, "time offset");
  EXPECT_EQ(spec.unit, "s");
  EXPECT_EQ(spec.transform, ParameterTransform::none);
  EXPECT_DOUBLE_EQ(spec.lower, -0.15);
  EXPECT_DOUBLE_EQ(spec.upper, 0.35);
  const Scene still =
      parse_scene_text(test::drag_scene(2, 4), "test.json",
                       settings({R"(/colliders/finger/path=[{"time":0,"position":[0,0,9]}])"}));
  EXPECT_THROW((void)describe_parameter(still, "/time/offset"), InputError);
  EXPECT_EQ(SceneModel(still).model().clock, -1);
}

TEST(TimeOffset, ACollidersFileMovesWithIt) {
  const std::string file = testing::TempDir() + "/offset_path.csv";
  FILE* out = std::fopen(file.c_str(), "w");
  std::fputs("time_s,x_mm,y_mm,z_mm\n0,-2,0,5.02\n0.13,-2,0,4.5\n1,8,2,4.5\n", out);
  std::fclose(out);
  const CertifiedCase c(
      test::drag_scene(2, 4),
      settings({"/colliders/finger/path=null", "/colliders/finger/path_file=" + file, "/time/offset=0.01"}));
  EXPECT_THAT(addresses_of(c), testing::Contains("/time/offset"));
  expect_right_gradient(c, *c.output, c.weights);
}

}  // namespace
}  // namespace rhytid::adjoint
