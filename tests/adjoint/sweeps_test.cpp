// Tangent and adjoint sweeps on a scene with contact, slip, viscosity and ligaments.
#include "adjoint/sweeps.h"

#include <gtest/gtest.h>

#include <random>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid::adjoint {
namespace {

const std::vector<std::string> kAddresses = {"/ligaments/sources/left/strength",
                                             "/ligaments/sources/right/strength",
                                             "/ligaments/diffusion_time",
                                             "/ligaments/stiffness",
                                             "/skin/layers/soft/youngs_modulus",
                                             "/skin/layers/film/youngs_modulus",
                                             "/skin/layers/soft/relaxation_time",
                                             "/skin/layers/film/relaxation_time",
                                             "/skin/layers/soft/stiffening",
                                             "/skin/layers/soft/relaxing_fraction",
                                             "/colliders/finger/friction/coefficient"};

struct Case {
  SceneModel scene_model;
  RunOptions options;
  Trajectory run;
  explicit Case(const std::string& text)
      : scene_model(parse_scene_text(text, "test.json")), options(scene_model.run_options()) {
    options.minimiser.polish = true;
    options.minimiser.relative_tolerance = 1e-10;
    run = simulate(scene_model.model(), scene_model.native(), options);
  }
  std::vector<MaterialPoint> points() const {
    std::vector<MaterialPoint> p;
    for (int f = 0; f < scene_model.model().mesh.num_faces; f += 3) p.push_back({f, 0.3, 0.4, true});
    return p;
  }
  MatrixXd directions() const {
    MatrixXd d(scene_model.native().size(), kAddresses.size());
    for (std::size_t k = 0; k < kAddresses.size(); ++k)
      d.col(k) = scene_model.native_derivative(scene_model.scene(), kAddresses[k]);
    return d;
  }
};

std::vector<VectorXd> random_weights(const Trajectory& run, const Output& output, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> n;
  std::vector<VectorXd> w;
  for (int f = 0; f <= run.frames(); ++f) {
    w.emplace_back(output.size(f));
    for (double& x : w.back()) x = n(rng);
  }
  return w;
}

TEST(Sweeps, TangentAndAdjointAreTransposes) {
  for (const auto& [order, scheme, rim] :
       {std::tuple{2, "stacked", "clamped"}, {3, "composite", "sliding"}}) {
    Case c(test::drag_scene(order, 10, scheme, rim));
    ASSERT_TRUE(c.run.complete) << c.run.failure;
    const PointPositions output(c.scene_model.model().mesh, c.points());
    const MatrixXd directions = c.directions();
    const auto weights = random_weights(c.run, output, 5);
    const auto tangent =
        tangent_sweep(c.scene_model.model(), c.scene_model.native(), c.run, output, directions);
    const auto adjoint = adjoint_sweep(c.scene_model.model(), c.scene_model.native(), c.run, output, weights);
    VectorXd forward = VectorXd::Zero(directions.cols());
    double scale = 0;
    for (int f = 0; f <= c.run.frames(); ++f)
      if (output.size(f) > 0) forward += tangent.frames[f].transpose() * weights[f];
    const VectorXd backward = directions.transpose() * adjoint.native_bar;
    for (int f = 0; f <= c.run.frames(); ++f)
      if (output.size(f) > 0) scale = std::max(scale, tangent.frames[f].norm() * weights[f].norm());
    for (Eigen::Index k = 0; k < forward.size(); ++k) {
      EXPECT_NE(forward[k], 0.0) << kAddresses[k];
      EXPECT_NEAR(forward[k], backward[k], 1e-11 * std::max(std::fabs(forward[k]), 1e-3 * scale))
          << kAddresses[k];
      std::printf("%-40s % .12e % .12e rel %.1e\n", kAddresses[k].c_str(), forward[k], backward[k],
                  std::fabs(forward[k] - backward[k]) / std::fabs(forward[k]));
    }
    std::printf(
        "residual max %.2e, adjoint error bar %.2e, steps %zu, forward %.2f s, tangent %.2f s, adjoint %.2f "
        "s\n",
        *std::max_element(adjoint.report.residual.begin(), adjoint.report.residual.end()),
        adjoint.residual_error, c.run.steps.size(), c.run.seconds, tangent.report.seconds,
        adjoint.report.seconds);
  }
}

}  // namespace
}  // namespace rhytid::adjoint
