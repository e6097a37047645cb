// Whole fits on a small scene: derivatives, recovery, agreement of the optimisers, rank deficiency, failure.
#include "fitting/fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "sim/core/error.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

using testing::HasSubstr;

constexpr int kFrames = 6;
constexpr double kSigma = 0.02;  // px

FitInput make_input(FitCase fit, unsigned seed = 1, double sigma = kSigma) {
  const Scene scene = test::drag_scene(kFrames);
  const Camera camera = test::make_camera();
  FitInput input{scene, camera, test::make_tracks(scene, camera, 4, sigma, seed), std::move(fit), {}};
  for (const ParameterSpec& spec : all_parameters(scene)) input.truth[spec.address] = spec.value;
  return input;
}

TEST(FitProblem, JacobianAndGradientMatchDifferences) {
  FitCase fit = test::three_parameters();
  fit.parameters.push_back(test::fitted("/skin/layers/soft/youngs_modulus", 0.025));  // penalties follow
  fit.parameters[0].prior_sigma = 0.2;
  const FitInput input = make_input(fit);
  FitProblem problem(input.scene, fit, input.camera, input.tracks);
  const VectorXd t = problem.parametrisation().initial() + VectorXd::Constant(4, 0.03);
  const double cost = problem.evaluate(t).cost;
  const VectorXd z = problem.evaluate(t).residuals;
  EXPECT_NEAR(cost, 0.5 * z.squaredNorm(), 1e-12 * cost);
  const auto jacobian = problem.jacobian(t);
  const auto gradient = problem.gradient(t);
  ASSERT_TRUE(jacobian && gradient);
  EXPECT_EQ(problem.counters().forward_runs, 1) << "value and derivatives share a run";
  EXPECT_LT((jacobian->transpose() * z - *gradient).norm(), 1e-8 * gradient->norm());
  for (const Eigen::Vector4d& direction :
       {Eigen::Vector4d(1, -0.5, 0.7, 0.3), Eigen::Vector4d(-0.2, 0.4, 0.3, 1)}) {
    const double h = 1e-4;
    const FitEvaluation plus = problem.evaluate(t + h * direction),
                        minus = problem.evaluate(t - h * direction);
    const VectorXd difference = (plus.residuals - minus.residuals) / (2 * h);
    const double slope = (plus.cost - minus.cost) / (2 * h);
    EXPECT_NEAR(slope, gradient->dot(direction), 1e-5 * gradient->norm());
    EXPECT_LT((*jacobian * direction - difference).norm(), 1e-4 * difference.norm());
  }
}

/// Frame 0 of a scene with pre-stretch shows the settled skin: exact tracks of it leave nothing at the truth.
TEST(FitProblem, TracksAttachToTheSettledSkin) {
  const Scene scene =
      test::drag_scene(2, {R"(/skin/pre_stretch={"stretch": 1.1, "across": 0.95, "direction": [1, 0, 0]})",
                           R"(/skin/rim="free")"});
  const Camera camera = test::make_camera();
  FitCase fit = test::three_parameters();
  for (FitParameter& parameter : fit.parameters) parameter.initial.reset();  // those of the scene
  FitProblem problem(scene, fit, camera, test::make_tracks(scene, camera, 2, 0, 3));
  EXPECT_GT(problem.registration().tracks.size(), 10u);
  EXPECT_LT(problem.evaluate(problem.parametrisation().initial()).cost, 1e-3);
}

TEST(Fit, RecoversThreeParametersAndBothOptimisersAgree) {
  FitInput input = make_input(test::three_parameters());
  const FitResult ceres = run_fit(input);
  std::printf("%s", answer_text(ceres).c_str());
  for (const FitIteration& i : ceres.history)
    std::printf("  %d runs %d cost %.6f |g| %.2e step %.2e\n", i.iteration, i.evaluations, i.cost,
                i.gradient_norm, i.step_norm);
  EXPECT_TRUE(ceres.converged) << ceres.status;
  EXPECT_LE(ceres.forward_runs, 12);
  EXPECT_NEAR(ceres.reduced_chi_square, 1, 0.1);
  for (const FittedParameter& p : ceres.parameters) {
    EXPECT_LT(p.sigma, 0.15) << p.name;
    EXPECT_TRUE(p.determined);
    EXPECT_FALSE(p.at_bound);
    EXPECT_LT(p.low95, p.value);
    EXPECT_GT(p.high95, p.value);
    EXPECT_LT(std::fabs(std::log(p.value / *p.truth)), 4 * p.sigma) << p.name;
  }
  ASSERT_EQ(ceres.derived.size(), 1u);
  EXPECT_NEAR(ceres.derived[0].value, 50, 3);
  EXPECT_THAT(ceres.gauge, HasSubstr("layer soft was held"));

  input.options.optimiser = "nlopt";
  input.options.max_evaluations = 60;
  const FitResult nlopt = run_fit(input);
  std::printf("%s", answer_text(nlopt).c_str());
  EXPECT_TRUE(nlopt.converged) << nlopt.status;
  EXPECT_NEAR(nlopt.final_cost, ceres.final_cost, 1e-4);
  for (std::size_t k = 0; k < ceres.parameters.size(); ++k)
    EXPECT_LT(std::fabs(std::log(nlopt.parameters[k].value / ceres.parameters[k].value)),
              0.05 * ceres.parameters[k].sigma);
}

TEST(Fit, WildTracksAreDiscounted) {
  FitInput input = make_input(test::three_parameters(), 4);
  for (std::size_t i = 0; i < input.tracks.tracks.size(); i += 10)
    for (Observation& o : input.tracks.tracks[i].observations)
      if (o.frame == 5) o.pixel += Vec2(20, -15);
  const FitResult robust = run_fit(input);
  for (const FittedParameter& p : robust.parameters)
    EXPECT_LT(std::fabs(std::log(p.value / *p.truth)), 4 * p.sigma) << p.name;
  int discounted = 0;
  for (const FitResidual& r : robust.residuals) discounted += r.weight < 0.1 ? 1 : 0;
  EXPECT_GE(discounted, 5);
}

TEST(Fit, FreeGaugeIsReportedAndTheRatioSurvives) {
  FitCase fit = test::three_parameters();
  for (FitParameter& p : fit.parameters)
    p.initial.reset();  // near the truth: the interest is in what is said
  fit.parameters.push_back(test::fitted("/skin/layers/soft/youngs_modulus"));
  fit.parameters.push_back(test::fitted("/ligaments/stiffness"));
  fit.max_evaluations = 15;
  const FitResult result = run_fit(make_input(fit));
  std::printf("%s", answer_text(result).c_str());
  ASSERT_EQ(result.singular_values.size(), 5);
  EXPECT_LT(result.singular_values[4], 1e-7 * result.singular_values[0]);
  const VectorXd null = result.right_vectors.col(4);
  for (const int k : {1, 3, 4}) EXPECT_NEAR(null[k], 1 / std::sqrt(3.), 1e-4) << "the gauge direction";
  EXPECT_FALSE(result.parameters[1].determined);
  EXPECT_FALSE(result.parameters[3].determined);
  EXPECT_TRUE(std::isnan(result.parameters[3].sigma));
  ASSERT_FALSE(result.cannot_tell.empty());
  EXPECT_THAT(result.cannot_tell[0], HasSubstr("go together"));
  EXPECT_THAT(result.gauge, HasSubstr("only their ratios"));
  ASSERT_EQ(result.derived.size(), 1u);
  EXPECT_GT(result.derived[0].high95, 50);
  EXPECT_LT(result.derived[0].low95, 50);
  EXPECT_LT(result.derived[0].high95 / result.derived[0].low95, 2);
}

TEST(Fit, PenaltyIsNoYardstick) {
  // The same question in two gauges: the soft modulus held, or the film's. Were the penalties fixed in
  // MPa/mm, they would tie the tissue to an absolute scale and the two ratios would differ.
  const auto fit_with = [](const char* modulus, double start) {
    FitCase fit = test::three_parameters();
    fit.parameters = {test::fitted(modulus, start), test::fitted("/ligaments/stiffness")};
    return run_fit(make_input(fit));
  };
  const FitResult soft_held = fit_with("/skin/layers/film/youngs_modulus", 0.8);
  const FitResult film_held = fit_with("/skin/layers/soft/youngs_modulus", 0.025);
  ASSERT_TRUE(soft_held.converged && film_held.converged);
  EXPECT_NEAR(soft_held.final_cost, film_held.final_cost, 1e-4);
  EXPECT_NEAR(soft_held.derived.at(0).value / film_held.derived.at(0).value, 1, 1e-4);
  EXPECT_NEAR(soft_held.derived[0].high95 / film_held.derived[0].high95, 1, 1e-3);
  EXPECT_THAT(film_held.gauge, HasSubstr("penalties followed"));
}

TEST(Fit, TruthInAnotherGaugeIsComparedPerUnitOfTheHeldModulus) {
  FitCase fit = test::three_parameters();
  fit.max_evaluations = 1;
  FitInput input = make_input(fit);
  input.truth = {{"/skin/layers/soft/youngs_modulus", 0.04},
                 {"/skin/layers/film/youngs_modulus", 2},
                 {"/colliders/finger/friction/coefficient", 0.4}};
  const FitResult result = run_fit(input);
  EXPECT_FALSE(result.parameters[0].truth);
  EXPECT_DOUBLE_EQ(*result.parameters[1].truth, 1);
  EXPECT_DOUBLE_EQ(*result.parameters[2].truth, 0.4);
}

// Camera and path with clocks of their own: their offset is a nuisance parameter like friction.
TEST(Fit, FindsHowFarThePathsClockRunsAhead) {
  FitCase fit = test::three_parameters();
  fit.parameters.push_back(test::fitted("/time/offset"));
  FitInput input = make_input(fit);
  input.tracks =
      test::make_tracks(test::drag_scene(kFrames, {"/time/offset=0.015"}), test::make_camera(), 4, kSigma, 2);
  input.truth["/time/offset"] = 0.015;
  const FitResult result = run_fit(input);
  EXPECT_TRUE(result.converged) << result.status;
  const FittedParameter& offset = result.parameters.at(3);
  EXPECT_EQ(offset.unit, "s");
  EXPECT_NEAR(offset.value, 0.015, 2e-3);
  EXPECT_LT(offset.low95, 0.015);
  EXPECT_GT(offset.high95, 0.015);
  EXPECT_TRUE(offset.determined);
}

TEST(Fit, FailedForwardRunsAreAStatus) {
  FitInput input = make_input(test::three_parameters());
  input.scene.solver.max_iterations = 1;
  input.scene.time.max_bisections = 0;
  for (const char* optimiser : {"ceres", "nlopt"}) {
    input.options.optimiser = optimiser;
    const FitResult result = run_fit(input);
    EXPECT_FALSE(result.converged);
    EXPECT_THAT(result.status, HasSubstr("failed"));
    EXPECT_EQ(result.parameters.size(), 3u);
  }
}

TEST(Fit, StopsWhenTold) {
  FitInput input = make_input(test::three_parameters());
  input.options.max_evaluations = 2;
  const FitResult spent = run_fit(input);
  EXPECT_EQ(spent.status, "max_evaluations");
  EXPECT_LE(spent.forward_runs, 3);
  FitObserver observer;
  observer.should_stop = [] { return true; };
  EXPECT_THAT(run_fit(input, observer).status, HasSubstr("stopped"));
}

TEST(Fit, BadCasesAreRefusedInOneLine) {
  const FitInput good = make_input(test::three_parameters());
  const auto message = [&](const std::function<void(FitInput&)>& spoil) -> std::string {
    FitInput input = good;
    spoil(input);
    try {
      run_fit(input);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message([](FitInput& i) { i.options.parameters.clear(); }), HasSubstr("at least one"));
  EXPECT_THAT(message([](FitInput& i) { i.options.parameters[1] = i.options.parameters[0]; }),
              HasSubstr("each address once"));
  EXPECT_THAT(message([](FitInput& i) { i.options.parameters[0].initial = -1; }), HasSubstr("initial"));
  EXPECT_THAT(message([](FitInput& i) { i.options.parameters[0].lower = 500; }), HasSubstr("lower < upper"));
  EXPECT_THAT(message([](FitInput& i) { i.options.gauge_layer = "bone"; }), HasSubstr("bone"));
  EXPECT_THAT(message([](FitInput& i) { i.options.optimiser = "magic"; }), HasSubstr("magic"));
  EXPECT_THAT(message([](FitInput& i) { i.tracks.tracks.clear(); }), HasSubstr("usable observations"));
  EXPECT_THAT(message([](FitInput& i) { i.scene.time.frame_rate = 60; }), HasSubstr("frame_rate is 60 1/s"));
}

}  // namespace
}  // namespace rhytid::fitting
