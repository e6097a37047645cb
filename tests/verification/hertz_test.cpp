// A rigid sphere on a deep soft layer (B13): the force of Hertz, with the known correction for a layer that
// is not infinitely deep.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "sim/scene/scene_model.h"

namespace rhytid {
namespace {

/// Flat quarter patch with vertices at the given distances from its corner; symmetric about its diagonal.
std::string write_graded_quarter(const std::vector<double>& at) {
  const std::string file =
      (std::filesystem::temp_directory_path() / ("rhytid_quarter_" + std::to_string(getpid()) + ".obj"))
          .string();
  std::ofstream out(file);
  const int n = static_cast<int>(at.size());
  for (const double y : at)
    for (const double x : at) out << "v " << x << ' ' << y << " 0\n";
  for (int j = 0; j + 1 < n; ++j)
    for (int i = 0; i + 1 < n; ++i) {
      const int a = j * n + i + 1, b = a + 1, c = a + n, d = c + 1;
      out << "f " << a << ' ' << b << ' ' << d << "\nf " << a << ' ' << d << ' ' << c << '\n';
    }
  return file;
}

TEST(Hertz, SphereOnADeepLayer) {
  const double youngs_modulus = 0.02, poissons_ratio = 0.49, radius = 8, depth = 0.2;
  const std::string file = write_graded_quarter({0, 0.4, 0.8, 1.2, 1.7, 2.6, 4.5, 8.5, 18, 40});
  Scene scene;
  scene.name = scene.file = "hertz";
  scene.skin.surface.file = file;
  scene.skin.surface.mm_per_unit = 1;
  scene.skin.order = 2;
  scene.skin.rim = RimCondition::sliding;  // two walls of symmetry, two far away
  double height = 0;
  for (const double thickness : {24.0, 9.0, 4.0, 1.6, 0.8, 0.6}) {
    LayerScene layer;
    layer.name = "layer " + std::to_string(thickness);
    layer.thickness = thickness;
    layer.youngs_modulus = youngs_modulus;
    layer.poissons_ratio = poissons_ratio;
    layer.relaxing_fraction = 0;
    scene.skin.layers.push_back(layer);
    height += thickness;
  }
  scene.base = BaseScene{};  // smooth plane under the layer
  scene.base->centre = Vec3(0, 0, -height);
  scene.base->stiffness = 10;
  ColliderScene ball;
  ball.name = "ball";
  ball.radius = radius;
  ball.stiffness = 5;  // gives 0.13 per cent of the depth at the peak pressure
  ball.onset = 1e-4;
  ball.path = {{0, Vec3(0, 0, radius - depth)}};
  scene.colliders = {ball};
  scene.time.frames = 1;
  scene.skin.contact_degree = 12;
  const SceneModel m(scene);
  std::filesystem::remove(file);
  RunOptions options = m.run_options();
  double force = 0;
  RunObserver observer;
  observer.step = [&](const StepEvent& event) {
    for (std::size_t k = 0; k < m.model().terms.size(); ++k) {
      const Term& term = m.model().terms[k];
      if (term.name() != "contact ball") continue;
      VectorXd g = VectorXd::Zero(event.state.u.size());
      (void)term.energy(event.problem.step(), event.problem.data(k), event.state.u, &g, nullptr);
      for (Eigen::Index i = 2; i < g.size(); i += 3) force += 4 * g[i];
    }
  };
  const Trajectory run = simulate(m.model(), m.native(), options, observer);
  ASSERT_TRUE(run.complete) << run.failure;
  const double plane_modulus = youngs_modulus / (1 - poissons_ratio * poissons_ratio);
  const double hertz = 4. / 3 * plane_modulus * std::sqrt(radius) * std::pow(depth, 1.5);
  EXPECT_NEAR(hertz, 8.87774e-3, 1e-8);
  // Layer of height h that slides on its base: 1 + 0.884 χ + 0.781 χ² + ..., χ = √(R d)/h [Dimitriadis et
  // al., Biophys. J. 82 (2002), for ν = 1/2].
  const double chi = std::sqrt(radius * depth) / height, finite = 1 + 0.884 * chi + 0.781 * chi * chi;
  std::printf("Hertz: %d nodes, force %.5e N, reference %.5e (half space) %.5e (layer), error %.2f %%\n",
              m.model().num_nodes(), force, hertz, hertz * finite, 100 * (force / (hertz * finite) - 1));
  EXPECT_NEAR(force, hertz * finite, 0.03 * hertz);
}

}  // namespace
}  // namespace rhytid
