// Fits of scenes whose frame 0 is itself an unknown: skin settled under a pre-stretch.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "fitting/fit.h"
#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting {
namespace {

constexpr double kTruth = 1.1;
constexpr const char* kStretch = "/skin/pre_stretch/stretch";

FitInput make_input(double start) {
  const Scene scene = test::drag_scene(4, {"/skin/pre_stretch={\"stretch\": 1.1}", "/skin/rim=sliding"});
  const Camera camera = test::make_camera();
  FitCase fit;
  fit.discretisation_check = false;
  fit.consider.emplace();
  fit.min_sigma = 0.005;
  fit.parameters = {test::fitted(kStretch, start),
                    test::fitted("/colliders/finger/friction/coefficient", 0.5)};
  return {scene, camera, test::make_tracks(scene, camera, 3, 0.002, 3), fit, {}};
}

TEST(FitUnderPreStretch, DerivativesIncludeWhereFrameZeroIs) {
  const FitInput input = make_input(1.06);
  FitProblem problem(input.scene, input.options, input.camera, input.tracks);
  const VectorXd t = problem.parametrisation().initial() + VectorXd::Constant(2, 0.01);
  const VectorXd z = problem.evaluate(t).residuals;
  const auto jacobian = problem.jacobian(t);
  const auto gradient = problem.gradient(t);
  ASSERT_TRUE(jacobian && gradient);
  EXPECT_LT((jacobian->transpose() * z - *gradient).norm(), 1e-8 * gradient->norm());
  for (int k = 0; k < 2; ++k) {
    const VectorXd step = 1e-4 * VectorXd::Unit(2, k);
    const VectorXd plus = problem.evaluate(t + step).residuals, minus = problem.evaluate(t - step).residuals;
    const VectorXd difference = (plus - minus) / 2e-4;
    EXPECT_LT((jacobian->col(k) - difference).norm(), 1e-4 * difference.norm()) << k;
  }
}

// Tracks used to be compared with the place where the starting value had put the skin.
TEST(FitUnderPreStretch, TheStartDoesNotMatter) {
  for (const double start : {1.1, 1.03}) {
    const FitResult result = run_fit(make_input(start));
    std::printf("from %.2f: %s", start, answer_text(result).c_str());
    ASSERT_TRUE(result.converged) << result.status;
    EXPECT_NEAR(result.parameters[0].value, kTruth, 4e-3) << start;
    EXPECT_NEAR(result.parameters[1].value, 0.4, 4e-3) << start;
  }
}

}  // namespace
}  // namespace rhytid::fitting
