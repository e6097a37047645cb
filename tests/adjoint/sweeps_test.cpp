// Tangent and adjoint sweeps: transposes of each other and derivatives of the simulation, for every damper
// scheme and mollifier, with substeps, over twenty steps, without history; what is refused.
#include "adjoint/sweeps.h"

#include <gtest/gtest.h>

#include "adjoint/resimulate.h"
#include "sim/core/parallel.h"
#include "sim/time/step_passes.h"
#include "tests/adjoint/gradient_checks.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

std::vector<std::string> settings(std::vector<std::string> more = {}) {
  more.insert(more.begin(), {"/skin/surface/grid/cells=[3,2]", "/skin/layers/soft/order=1"});
  return more;
}

class Variant : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(Variant, GradientIsRight) {
  // With a clock that runs ahead, so that no step ends where a path has a kink.
  std::vector<std::string> changes = GetParam();
  changes.emplace_back("/time/offset=0.01");
  const CertifiedCase c(test::drag_scene(2, 10), settings(changes));
  ASSERT_THAT(addresses_of(c), testing::Contains("/time/offset"));
  expect_right_gradient(c, *c.output, c.weights);
}

INSTANTIATE_TEST_SUITE_P(
    Sweeps, Variant,
    testing::Values(
        std::vector<std::string>{"/time/damper=exponential", "/time/frames=20"},
        std::vector<std::string>{"/time/damper=literal", "/colliders/finger/friction/mollifier=quadratic"},
        std::vector<std::string>{"/time/damper=strang"},
        std::vector<std::string>{"/time/damper=backward_euler",
                                 "/colliders/finger/friction/mollifier=quadratic"},
        std::vector<std::string>{"/time/substeps=2", "/time/frames=5", "/skin/rim=sliding"},
        // Frame 0 depends on the parameters: a settling step under tension.
        std::vector<std::string>{"/skin/pre_stretch={\"stretch\":1.1}", "/time/frames=6"},
        std::vector<std::string>{"/skin/pre_stretch={\"stretch\":1.08,\"across\":0.97,"
                                 "\"direction\":[1,0.4,0]}",
                                 "/skin/quadrature/volume=reduced", "/skin/layers/film/relaxing_fraction=0",
                                 "/time/frames=6"},
        std::vector<std::string>{"/ligaments/law=fung_quadratic", "/skin/quadrature/prism_degree=5"},
        // A capsule that rolls and turns along a spline; an ellipsoid.
        std::vector<std::string>{"/colliders/finger/shape=capsule", "/colliders/finger/length=4",
                                 "/colliders/finger/axis=[0,1,0.02]",
                                 "/colliders/finger/interpolation=spline",
                                 "/colliders/finger/path/2/rotation=[0.1,0.6,0.4]"},
        std::vector<std::string>{"/colliders/finger/shape=ellipsoid", "/colliders/finger/semi_axes=[7,4,5]",
                                 "/colliders/finger/path/2/rotation=[0,-0.3,0.5]"},
        // Every step solved again with its own normal force.
        std::vector<std::string>{"/time/lag_passes=2"},
        std::vector<std::string>{"/time/lag_passes=4", "/time/frames=5",
                                 "/colliders/finger/friction/mollifier=quadratic"},
        // Friction whose normal force and direction are extrapolated.
        std::vector<std::string>{"/time/lag=extrapolated"},
        std::vector<std::string>{"/time/lag=extrapolated", "/time/substeps=2", "/time/frames=5",
                                 "/skin/pre_stretch={\"stretch\":1.1}",
                                 "/colliders/finger/friction/mollifier=quadratic"},
        std::vector<std::string>{"/time/lag=extrapolated", "/colliders/finger/shape=ellipsoid",
                                 "/colliders/finger/semi_axes=[7,4,5]",
                                 "/colliders/finger/path/2/rotation=[0,-0.3,0.5]"},
        // A side of the rim that is moved while the finger drags.
        std::vector<std::string>{
            "/skin/held=[{\"name\":\"side\",\"box\":{\"low\":[-8,-6,0],\"high\":[-8,6,0]},"
            "\"path\":[{\"time\":0,\"displacement\":[0,0,0]},"
            "{\"time\":0.5,\"displacement\":[0.7,0.3,0.1]}]}]"},
        // One layer relaxes, the other does not: two skin terms.
        std::vector<std::string>{"/skin/layers/film/relaxing_fraction=0", "/skin/rim=free"}));

/// Slopes of the Taylor remainder along each of some parameters by itself, in a run where the finger slides.
void expect_slopes_of_two(const CertifiedCase& c, const std::vector<std::string>& addresses) {
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  const AdjointResult adjoint = adjoint_sweep(c.model(), c.scene_model.native(), c.run, *c.output, c.weights);
  const FunctionalDifference functional(c.scene_model, c.run, *c.output, c.weights,
                                        certificate_minimiser({}));
  const ParameterSpace all(c.scene_model, addresses);
  EXPECT_LT(duality(c, *c.output, c.weights, all.jacobian(), adjoint), 1e-12);
  for (const std::string& address : addresses) {
    SCOPED_TRACE(address);
    const ParameterSpace space(c.scene_model, {address});
    const VectorXd gradient = space.jacobian().transpose() * adjoint.native_bar, one = VectorXd::Ones(1);
    const double noise = measure_noise(functional, space, one);
    const TaylorSeries s = taylor_test(functional, space, one, gradient, noise, {});
    ASSERT_FALSE(s.slopes.empty()) << s.sentence;
    std::printf("%s: slope %.4f, %s\n", address.c_str(), s.slopes.back(), s.sentence.c_str());
    EXPECT_TRUE(s.passed) << s.sentence;
    EXPECT_GT(s.slopes.back(), 1.95);
    EXPECT_LT(s.slopes.back(), 2.05);
  }
}

const std::vector<std::string> kOfASlidingFinger = {
    "/colliders/finger/friction/coefficient", "/colliders/finger/path/2/position/0",
    "/colliders/finger/path/1/position/2", "/skin/layers/soft/youngs_modulus",
    "/skin/layers/film/youngs_modulus"};

TEST(Sweeps, ExtrapolatedLagHasTheSlopesOfEachParameter) {
  const CertifiedCase c(test::drag_scene(2, 10), settings({"/time/lag=extrapolated", "/time/offset=0.01"}));
  long slipping = 0;
  for (std::size_t t = 0; t < c.model().terms.size(); ++t) {
    if (c.model().terms[t].name() != "friction finger") continue;
    StepPasses passes(c.model(), c.scene_model.native(), c.run.steps.back().step, c.run.before(9), {});
    for (const signed char piece :
         c.model().terms[t].regimes(passes.last().step(), passes.last().data(t), c.run.steps.back().state.u))
      slipping += piece == 2;
  }
  EXPECT_GT(slipping, 10) << "does it slide?";
  expect_slopes_of_two(c, kOfASlidingFinger);
}

/// The middle steps of a run halved, so that a step is half as long as the one before it, and one twice as long.
TEST(Sweeps, ExtrapolatedLagOverHalvedSteps) {
  CertifiedCase c(test::drag_scene(2, 6), settings({"/time/lag=extrapolated", "/time/offset=0.01"}));
  ASSERT_TRUE(c.run.complete) << c.run.failure;
  Trajectory halved = c.run;
  halved.steps.clear();
  halved.frame_end = {0};
  for (int i = 0; i < 6; ++i) {
    const StepRecord& whole = c.run.steps[static_cast<std::size_t>(i)];
    std::vector<double> times = {whole.step.t_old, whole.step.t};
    if (i == 3 || i == 4) times.insert(times.begin() + 1, 0.5 * (whole.step.t_old + whole.step.t));
    for (std::size_t k = 0; k + 1 < times.size(); ++k) {
      StepRecord part = whole;
      part.step = {static_cast<int>(halved.steps.size()), times[k], times[k + 1]};
      part.bisections = times.size() > 2 ? 1 : 0;
      halved.steps.push_back(std::move(part));
    }
    halved.frame_end.push_back(static_cast<int>(halved.steps.size()));
  }
  c.run = resimulate(c.model(), c.scene_model.native(), halved, c.options.minimiser, {}, {}, true);
  ASSERT_EQ(c.run.steps.size(), 8u);
  EXPECT_NEAR(c.run.steps[3].step.dt() / c.run.steps[2].step.dt(), 0.5, 1e-12);
  EXPECT_NEAR(c.run.steps[7].step.dt() / c.run.steps[6].step.dt(), 2, 1e-12);
  expect_slopes_of_two(c, {kOfASlidingFinger[0], kOfASlidingFinger[1], kOfASlidingFinger[3]});
}

TEST(Sweeps, ElasticSceneHasNoHistory) {
  const CertifiedCase c(test::drag_scene(2, 4), settings({"/skin/layers/soft/relaxing_fraction=0",
                                                          "/skin/layers/film/relaxing_fraction=0",
                                                          "/colliders/finger/friction/coefficient=0"}));
  EXPECT_EQ(c.model().history_size(), 0u);
  expect_right_gradient(c, *c.output, c.weights);
}

/// A mean square over displacement and history: nonlinear, and looks at all of the state.
class MeanSquare final : public Output {
 public:
  int size(int frame) const override { return frame > 0 && frame % 2 == 0 ? 1 : 0; }
  VectorXd values(int frame, const State& s) const override {
    VectorXd out(size(frame));
    if (out.size() > 0) out[0] = 0.5 * (s.u.squaredNorm() + 1e2 * s.history.squaredNorm());
    return out;
  }
  MatrixXd tangent(int frame, const State& s, const MatrixXd& du, const MatrixXd& ds) const override {
    MatrixXd out(size(frame), du.cols());
    if (out.rows() > 0) out = s.u.transpose() * du + 1e2 * s.history.transpose() * ds;
    return out;
  }
  void adjoint(int, const State& s, const VectorXd& w, VectorXd& u_bar, VectorXd& s_bar) const override {
    u_bar += w[0] * s.u;
    s_bar += 1e2 * w[0] * s.history;
  }
};

TEST(Sweeps, OutputsMayReadTheHistoryAndBeNonlinear) {
  const CertifiedCase c(test::drag_scene(2, 6), settings());
  const MeanSquare output;
  expect_right_gradient(c, output, random_weights(output, c.run.frames(), 2));
}

const CertifiedCase& small_case() {
  static const CertifiedCase c(test::drag_scene(2, 4), settings());
  return c;
}

TEST(Sweeps, SameBitsAgainAndOnTwoThreads) {
  const CertifiedCase& c = small_case();
  ASSERT_TRUE(c.run.complete);
  const int before = num_threads();
  const MatrixXd directions = ParameterSpace(c.scene_model, addresses_of(c)).jacobian();
  std::vector<AdjointResult> adjoints;
  std::vector<TangentResult> tangents;
  for (const int threads : {1, 1, 2}) {
    set_num_threads(threads);
    adjoints.push_back(adjoint_sweep(c.model(), c.scene_model.native(), c.run, *c.output, c.weights));
    tangents.push_back(tangent_sweep(c.model(), c.scene_model.native(), c.run, *c.output, directions));
  }
  set_num_threads(before);
  for (const int other : {1, 2}) {
    EXPECT_TRUE(adjoints[0].native_bar == adjoints[other].native_bar);
    EXPECT_EQ(adjoints[0].residual_error, adjoints[other].residual_error);
    for (int f = 0; f <= c.run.frames(); ++f)
      EXPECT_TRUE(tangents[0].frames[f] == tangents[other].frames[f]) << f;
  }
}

TEST(Sweeps, SayHowNearToAKinkOrABifurcationStepsAre) {
  const CertifiedCase& c = small_case();
  const auto adjoint = adjoint_sweep(c.model(), c.scene_model.native(), c.run, *c.output, c.weights);
  const auto tangent = tangent_sweep(c.model(), c.scene_model.native(), c.run, *c.output, adjoint.native_bar);
  ASSERT_EQ(adjoint.report.regime_changes.size(), c.run.steps.size());
  EXPECT_EQ(adjoint.report.regime_changes, tangent.report.regime_changes);
  EXPECT_EQ(adjoint.report.regime_changes[0], 0);
  // By hand, from the pieces of the last two steps.
  std::vector<signed char> pieces[2];
  for (const std::size_t k : {0u, 1u}) {
    const std::size_t i = c.run.steps.size() - 2 + k;
    StepPasses passes(c.model(), c.scene_model.native(), c.run.steps[i].step,
                      c.run.before(static_cast<int>(i)), {});
    pieces[k] = step_regimes(passes.last(), c.run.steps[i].state.u);
  }
  long changes = 0;
  for (std::size_t q = 0; q < pieces[0].size(); ++q) changes += pieces[0][q] != pieces[1][q];
  EXPECT_GT(changes, 0);
  EXPECT_EQ(adjoint.report.regime_changes.back(), changes);

  EXPECT_TRUE(adjoint.report.near_singular_steps().empty());
  SweepReport report = adjoint.report;
  report.smallest_pivot[2] *= 1e-3;
  EXPECT_EQ(report.near_singular_steps(), std::vector<int>{2});
  EXPECT_EQ(report.near_singular_steps(1e-4), std::vector<int>{});
}

TEST(Sweeps, ManyDirectionsAreTheSameAsOneAtATime) {
  const CertifiedCase& c = small_case();
  const MatrixXd directions = ParameterSpace(c.scene_model, addresses_of(c)).jacobian();
  ASSERT_GT(directions.cols(), 8);  // more than one chunk
  const auto all = tangent_sweep(c.model(), c.scene_model.native(), c.run, *c.output, directions);
  for (const Eigen::Index k : {Eigen::Index(2), directions.cols() - 1}) {
    const auto one = tangent_sweep(c.model(), c.scene_model.native(), c.run, *c.output, directions.col(k));
    for (int f = 1; f <= c.run.frames(); ++f)
      EXPECT_LE((one.frames[f] - all.frames[f].col(k)).norm(), 1e-13 * all.frames[f].col(k).norm()) << f;
  }
}

TEST(Sweeps, RefuseWhatHasNoGradient) {
  const CertifiedCase& c = small_case();
  const VectorXd native = c.scene_model.native();
  const MatrixXd direction = VectorXd::Ones(native.size());
  const auto expect_refused = [&](const VectorXd& parameters, const Trajectory& run, const std::string& why) {
    try {
      (void)adjoint_sweep(c.model(), parameters, run, *c.output, c.weights);
      ADD_FAILURE() << "not refused: " << why;
    } catch (const GradientError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(why));
    }
    EXPECT_THROW((void)tangent_sweep(c.model(), parameters, run, *c.output, direction), GradientError) << why;
  };
  Trajectory broken = c.run;
  broken.complete = false;
  broken.failure = "stopped by the test";
  expect_refused(native, broken, "stopped by the test");
  broken = c.run;
  for (StepRecord& step : broken.steps) step.state = {};
  expect_refused(native, broken, "kept no states");
  broken = c.run;
  broken.steps[1].report.status = MinimiserStatus::stagnated;
  expect_refused(native, broken, "did not converge (stagnated");
  broken = c.run;
  broken.steps[1].state.u *= 1e3;
  expect_refused(native, broken, "outside the domain");
  const StepProblem step(c.model(), native, c.run.steps[1].step, c.run.before(1));
  EXPECT_THROW((void)step.residual(broken.steps[1].state.u), ContractError)
      << "an infinite energy has no residual";
  VectorXd negative = native;
  for (const NativeBlock& block : c.model().native_blocks)
    for (const int i : block.stiffness_like) negative[i] = -native[i];
  expect_refused(negative, c.run, "not positive definite");
  EXPECT_THROW(
      (void)adjoint_sweep(c.model(), native, c.run, *c.output, std::vector<VectorXd>(c.weights.size() - 1)),
      ContractError);
}

TEST(Resimulate, ReturnsToTheRunFromTheStateBefore) {
  const CertifiedCase& c = small_case();
  const Trajectory again = resimulate(c.model(), c.scene_model.native(), c.run, certificate_minimiser({}));
  ASSERT_TRUE(again.complete) << again.failure;
  ASSERT_EQ(again.frames(), c.run.frames());
  for (int f = 1; f <= c.run.frames(); ++f)
    EXPECT_LT((again.at_frame(f).u - c.run.at_frame(f).u).norm(), 1e-12 * c.run.at_frame(f).u.norm());
}

// ∂native/∂x of every parameter against central differences, which are exact but for h². The scenes have
// every kind of parameter between them.
TEST(ParameterSpace, JacobianIsTheDerivativeOfNative) {
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{},
        {"/skin/pre_stretch={\"stretch\":1.1,\"across\":0.95,\"direction\":[1,0.2,0]}",
         "/colliders/finger/shape=ellipsoid", "/colliders/finger/semi_axes=[7,4,5]",
         "/colliders/finger/path/2/rotation=[0.1,0.6,0.4]", "/colliders/finger/interpolation=spline"}}) {
    const SceneModel model(parse_scene_text(test::drag_scene(2, 4), "test.json", settings(more)));
    const std::vector<ParameterSpec> all = all_parameters(model.scene());
    ASSERT_GE(all.size(), 30u);
    for (const ParameterSpec& spec : all) {
      const ParameterSpace space(model, {spec.address});
      ASSERT_EQ(space.size(), 1);
      const VectorXd exact = space.jacobian().col(0);
      const std::vector<std::string> none = heights_of_sources(model.scene());
      if (std::find(none.begin(), none.end(), spec.address) != none.end()) {
        EXPECT_EQ(exact.norm(), 0) << spec.address;
        EXPECT_LT((space.native(VectorXd::Constant(1, 2e-2)) - model.native()).norm(), 1e-12);
        continue;
      }
      ASSERT_GT(exact.norm(), 0) << spec.address;
      double errors[2];
      for (int k = 0; k < 2; ++k) {
        const VectorXd x = VectorXd::Constant(1, k == 0 ? 2e-2 : 1e-2);
        const VectorXd difference = (space.native(x) - space.native(-x)) / (2 * x[0]);
        errors[k] = (difference - exact).norm() / exact.norm();
      }
      EXPECT_LT(errors[1], 1e-3) << spec.address;
      if (errors[1] < 1e-11) continue;
      EXPECT_NEAR(std::log2(errors[0] / errors[1]), 2, 0.05) << spec.address;
    }
  }
}

TEST(ParameterSpace, CoordinatesFollowTheTransforms) {
  const CertifiedCase& c = small_case();
  const ParameterSpace space(c.scene_model, {"/ligaments/stiffness", "/skin/layers/soft/relaxing_fraction"});
  const std::vector<double> p = space.values((VectorXd(2) << std::log(2.0), 0).finished());
  EXPECT_NEAR(p[0], 2 * c.scene_model.scene().ligaments->stiffness, 1e-18);
  EXPECT_EQ(p[1], 0.8);
  EXPECT_GT(space.values((VectorXd(2) << 0, 40).finished())[1], 0.99);
  EXPECT_LE(space.values((VectorXd(2) << 0, 40).finished())[1], 0.999);
  EXPECT_TRUE(space.native(VectorXd::Zero(2)) == c.scene_model.native());
  // What a unit of a coordinate is: of a place half of what a fit may move it.
  const ParameterSpace knot(c.scene_model, {"/ligaments/stiffness", "/colliders/finger/path/0/position/0"});
  EXPECT_EQ(knot.coordinates()[0].transform, ParameterTransform::log);
  EXPECT_EQ(knot.coordinates()[1].transform, ParameterTransform::none);
  const double moved = knot.values(VectorXd::Unit(2, 1))[1] - knot.values(VectorXd::Zero(2))[1];
  EXPECT_NEAR(knot.coordinates()[1].scale, moved, 1e-12);
  EXPECT_NEAR(moved, 5, 1e-12);
  ParameterSpec spec = knot.specs()[0];
  spec.value = 0;  // has no logarithm
  EXPECT_EQ(coordinate_of(spec).transform, ParameterTransform::none);
  EXPECT_EQ(coordinate_of(spec).scale, spec.upper - spec.lower);
}

}  // namespace
}  // namespace rhytid::adjoint
