// What one element through a stiffness jump of 200:1 and more does to a film on a soft layer (
// T8), and which of two equilibria of a compressed film the minimiser takes (T13).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "film_strip.h"

namespace rhytid::test {
namespace {

/// Compliance of a column through the thickness, all sideways motion held, over that of its layers in series.
double measured_compliance(double film_fraction, double ratio, int composite_order) {
  Scene scene = slab_scene(2, 1, 1 - film_fraction, 1, 1, 2);
  LayerScene film = scene.skin.layers[0];
  film.name = "film";
  film.thickness = film_fraction;
  film.youngs_modulus *= ratio;
  scene.skin.layers.push_back(film);
  if (composite_order > 0) {
    scene.skin.scheme = ThicknessScheme::composite;
    scene.skin.composite_order = composite_order;
  }
  double series = 0;
  for (LayerScene& l : scene.skin.layers) {
    l.relaxing_fraction = 0;
    const double nu = l.poissons_ratio;
    series += l.thickness * (1 + nu) * (1 - 2 * nu) / (l.youngs_modulus * (1 - nu));
  }
  const SceneModel m(scene);
  const SkinMesh& mesh = m.model().mesh;
  const VectorXd native = m.native();
  const State rest = m.model().rest_state();
  StepProblem step(m.model(), native, {0, 0, 1}, rest);
  const double lift = 1e-7;
  VectorXd q = VectorXd::Zero(3 * mesh.num_nodes());
  std::vector<int> held;
  for (int i = 0; i < mesh.num_nodes(); ++i) {
    const int level = i % mesh.num_levels;
    held.insert(held.end(), {3 * i, 3 * i + 1});
    if (level == 0 || level == mesh.num_levels - 1) held.push_back(3 * i + 2);
    if (level == mesh.num_levels - 1) q[3 * i + 2] = lift;
  }
  LoadedProblem problem(step, held, VectorXd::Zero(q.size()));
  EXPECT_TRUE(problem.solve(q).converged());
  const VectorXd residual = step.residual(q);
  double force = 0;
  for (int c = 0; c < mesh.num_columns; ++c) force += residual[3 * mesh.node(c, mesh.num_levels - 1) + 2];
  return lift * 4 / force / series;
}

/// The same by minimising ∫ E w'² / 2 over polynomials of degree q with w(0) = 0: ∂w/∂z = Σ a_i i z^(i−1).
double polynomial_compliance(double film_fraction, double ratio, int q) {
  MatrixXd k(q, q);
  const double join = 1 - film_fraction;
  for (int i = 1; i <= q; ++i)
    for (int j = 1; j <= q; ++j) {
      const double n = i + j - 1;
      k(i - 1, j - 1) = i * j / n * (std::pow(join, n) + ratio * (1 - std::pow(join, n)));
    }
  const VectorXd one = VectorXd::Ones(q);
  return one.dot(k.ldlt().solve(one)) / (join + film_fraction / ratio);
}

TEST(FilmStates, OneElementThroughAJumpIsTooStiffByWhatItsPolynomialsSay) {
  const double published[2][3] = {{0.771, 0.750, 0.54}, {0.745, 0.61, 0.22}};
  const double fractions[] = {0.05, 0.1, 0.2};
  std::printf("transverse compliance over that of the layers in series\n");
  double worst = 0, worst_stacked = 0;
  for (int r = 0; r < 2; ++r)
    for (int f = 0; f < 3; ++f) {
      const double ratio = r == 0 ? 200 : 1000;
      std::printf("  %4.0f:1, film %2.0f %%:", ratio, 100 * fractions[f]);
      for (int q = 2; q <= 4; ++q) {
        const double own = polynomial_compliance(fractions[f], ratio, q),
                     measured = measured_compliance(fractions[f], ratio, q);
        std::printf(" q = %d %.4f,", q, measured);
        worst = std::max(worst, std::fabs(measured / own - 1));
        if (q == 2) {
          EXPECT_NEAR(measured, published[r][f], 0.0051);
        }
      }
      const double stacked = measured_compliance(fractions[f], ratio, 0);
      std::printf(" stacked %.6f\n", stacked);
      worst_stacked = std::max(worst_stacked, std::fabs(stacked - 1));
    }
  std::printf("  against the polynomials: %.1e; stacked against series: %.1e\n", worst, worst_stacked);
  EXPECT_LT(worst, 2e-6);
  EXPECT_LT(worst_stacked, 2e-6);
}

// Beyond the onset the flat film is still in equilibrium, but a saddle. Its wrinkles grow like
// A = h √(ε/ε_c − 1) (film theory), so A² is a straight line from the onset: a second way to find it.
TEST(FilmStates, TheCertificateRefusesTheFlatFilmAndFindsTheWrinkle) {
  const Stack stack{10, 1, 200, false};
  const Scheme scheme{"stacked 3|2", 0, 3, 1};
  const Onset onset = StackBifurcation(layers_of(stack), elements_of(scheme), false).onset(15, 40);
  Strip strip(stack, scheme, onset.wavelength);
  MinimiserOptions plain, certified;
  plain.certify_minimum = false;
  plain.relative_tolerance = certified.relative_tolerance = 1e-10;
  std::printf("film compressed to a multiple of its onset %.4f %%: amplitude / h (film theory)\n",
              100 * onset.strain);
  double squared[2] = {}, last = 0;
  for (const double multiple : {0.99, 1.01, 1.02, 1.1, 1.5}) {
    const VectorXd flat = strip.flat(multiple * onset.strain);
    VectorXd q = flat;
    const MinimiserReport saddle = strip.minimise_from(q, plain);
    EXPECT_TRUE(saddle.converged());
    EXPECT_EQ(strip.amplitude(q), strip.amplitude(flat)) << "nothing tells it that it stands on a saddle";
    const MinimiserReport report = strip.minimise_from(q, certified);
    ASSERT_TRUE(report.converged()) << name(report.status);
    EXPECT_GT(report.smallest_pivot, 0);
    const double amplitude = strip.amplitude(q);
    if (multiple < 1) {
      EXPECT_EQ(report.iterations, 0);
      EXPECT_LT(amplitude, 1e-9);
      continue;
    }
    std::printf("  %.2f: %.4f (%.4f), energy %.3e of the flat state's, %d iterations, %d exits\n", multiple,
                amplitude, std::sqrt(multiple - 1), report.energy / saddle.energy - 1, report.iterations,
                report.negative_curvature_exits);
    EXPECT_GE(report.negative_curvature_exits, 1);
    EXPECT_LT(report.energy, saddle.energy);
    EXPECT_NEAR(amplitude, std::sqrt(multiple - 1), 0.12 * std::sqrt(multiple - 1));
    EXPECT_GT(amplitude, last);
    last = amplitude;
    if (multiple < 1.03) squared[multiple > 1.015] = amplitude * amplitude;
  }
  const double extrapolated = (1.01 * squared[1] - 1.02 * squared[0]) / (squared[1] - squared[0]);
  std::printf("  A² vanishes at %.5f of the onset of the Hessian\n", extrapolated);
  EXPECT_NEAR(extrapolated, 1, 5e-4);
}

}  // namespace
}  // namespace rhytid::test
