// Viscoelastic histories without common axes against an integration that shares nothing with the simulator:
// the continuous flow rule in 80 bits, fourth-order Runge-Kutta, matrix logarithms by square roots and a
// series.
//
//   Ċ^v = C^v ln((C^v)⁻¹ C̄) / τ        S = 2 ∂ψ/∂C = [2 μ∞ e^(Cq) dev ½ ln C + μ_m ln((C^v)⁻¹ C̄) + K J (J−1)
//   I] C⁻¹
//
// (ln((C^v)⁻¹C̄) C⁻¹ is symmetric; the matrix products below keep that order.)
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "long_matrix.h"
#include "sim/terms/material_point.h"

namespace rhytid {
namespace {

using namespace test::long_matrix;

struct Constants {
  Real mu_inf, mu_m, bulk, stiffening, tau;
};
Constants constants(const SkinParameters& p) {
  const Real mu = p.youngs_modulus / (2 * (1 + static_cast<Real>(p.poissons_ratio)));
  return {(1 - static_cast<Real>(p.relaxing_fraction)) * mu, p.relaxing_fraction * mu,
          p.youngs_modulus / (3 * (1 - 2 * static_cast<Real>(p.poissons_ratio))), p.stiffening,
          p.relaxation_time};
}

/// Three histories over 0.4 s that never share their axes with their own past: a shear whose plane turns,
/// stretch along a turning axis, and shear after stretch.
Matrix deformation(int history, Real t) {
  const Real s = t / 0.4L, w = 3.0L * s;
  const Real c = std::cos(w), d = std::sin(w);
  switch (history) {
    case 0:
      return {{{1, 0.7L * s * c, 0.7L * s * d}, {0, 1, 0.2L * s}, {0, 0, 1}}};
    case 1: {
      const Matrix r = {{{c, -d, 0}, {d, c, 0}, {0, 0, 1}}};
      const Real stretch = 1 + 0.4L * s;
      const Matrix u = {{{stretch, 0, 0}, {0, 1 / std::sqrt(stretch), 0}, {0, 0, 1 / std::sqrt(stretch)}}};
      return product(product(r, u), transposed(r));
    }
    default:
      return {{{1 + 0.3L * std::sin(2 * w), 0.6L * s * s, 0},
               {0.1L * d, 1, 0.3L * s},
               {0, 0.2L * d, 1 - 0.1L * s}}};
  }
}
Matrix isochoric_strain(int history, Real t) {
  const Matrix f = deformation(history, t);
  return scaled(product(transposed(f), f), std::pow(determinant(f), -2.0L / 3));
}

/// P and C^v at the end, by `steps` Runge-Kutta steps.
struct Exact {
  Matrix piola, viscous;
};
Exact integrate(const Constants& k, int history, Real end, int steps) {
  Matrix cv = identity();
  const auto rate = [&](const Matrix& v, Real t) {
    return scaled(product(v, logarithm(product(inverse(v), isochoric_strain(history, t)))), 1 / k.tau);
  };
  const Real h = end / steps;
  for (int n = 0; n < steps; ++n) {
    const Real t = n * h;
    const Matrix a = rate(cv, t), b = rate(sum(cv, h / 2, a), t + h / 2),
                 c = rate(sum(cv, h / 2, b), t + h / 2), d = rate(sum(cv, h, c), t + h);
    cv = sum(cv, h / 6, sum(sum(a, 1, d), 2, sum(b, 1, c)));
  }
  const Matrix f = deformation(history, end), right = product(transposed(f), f);
  Matrix strain = scaled(logarithm(right), 0.5L);
  const Real j = determinant(f), mean = trace(strain) / 3;
  for (int i = 0; i < 3; ++i) strain[i][i] -= mean;
  const Real q = trace(product(strain, strain));
  Matrix n = scaled(strain, 2 * k.mu_inf * std::exp(k.stiffening * q));
  n = sum(n, k.mu_m, logarithm(product(inverse(cv), isochoric_strain(history, end))));
  n = sum(n, k.bulk * j * (j - 1), identity());
  return {product(f, product(n, inverse(right))), cv};
}

Mat3 to_double(const Matrix& a) {
  Mat3 m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = static_cast<double>(a[i][j]);
  return m;
}

constexpr double kEnd = 0.4;
constexpr int kHistories = 3;

MaterialProgram program(int history, int steps) {
  MaterialProgram p;
  for (int n = 0; n <= steps; ++n) {
    p.times.push_back(kEnd * n / steps);
    p.deformation.push_back(to_double(deformation(history, static_cast<Real>(kEnd) * n / steps)));
  }
  return p;
}

SkinParameters skin() {
  SkinParameters p;
  p.poissons_ratio = 0.45;
  return p;
}

TEST(ViscousHistory, TheReferenceItselfConverges) {
  const Constants k = constants(skin());
  for (int history = 0; history < kHistories; ++history) {
    const Exact coarse = integrate(k, history, kEnd, 200), fine = integrate(k, history, kEnd, 400);
    EXPECT_LT((to_double(coarse.piola) - to_double(fine.piola)).norm() / to_double(fine.piola).norm(), 1e-8);
    EXPECT_NEAR(static_cast<double>(determinant(fine.viscous)), 1, 1e-9);
    EXPECT_LT((to_double(fine.viscous) - to_double(transposed(fine.viscous))).norm(), 1e-14);
  }
}

/// Order in dt of every damper, in the stress and in C^v, and the error at 24 frames per second.
TEST(ViscousHistory, EveryDamperHasItsOrderAgainstTheFlowRule) {
  const SkinParameters p = skin();
  for (int history = 0; history < kHistories; ++history) {
    const Exact exact = integrate(constants(p), history, kEnd, 400);
    const Mat3 piola = to_double(exact.piola), viscous = to_double(exact.viscous);
    // Against the viscous part of the stress: the rest is the same in every scheme.
    SkinParameters relaxed = p;
    relaxed.relaxing_fraction = 0;
    relaxed.youngs_modulus *= 1 - p.relaxing_fraction;
    for (const auto& [scheme, name, order] : {std::tuple{DamperScheme::exponential, "exponential", 2},
                                              {DamperScheme::strang, "strang", 2},
                                              {DamperScheme::literal, "literal", 1},
                                              {DamperScheme::backward_euler, "backward_euler", 1}}) {
      std::vector<double> stress_error, history_error;
      for (const int steps : {10, 20, 40, 80, 160}) {
        const MaterialPointRun run = run_material_point(p, scheme, program(history, steps));
        ASSERT_TRUE(run.complete);
        stress_error.push_back((run.states.back().piola - piola).norm() / piola.norm());
        history_error.push_back((run.states.back().viscous - viscous).norm());
      }
      const auto rate = [](const std::vector<double>& e) { return std::log2(e[e.size() - 2] / e.back()); };
      std::printf(
          "history %d, %-14s stress error %.2e at dt = 0.04 s, %.2e at 0.0025 s, order %.2f; C^v %.2f\n",
          history, name, stress_error.front(), stress_error.back(), rate(stress_error), rate(history_error));
      EXPECT_GT(rate(stress_error), order - 0.1) << name;
      EXPECT_GT(rate(history_error), order - 0.1) << name;
      EXPECT_LT(stress_error.back(), order == 2 ? 2e-3 : 5e-2) << name;
    }
  }
}

/// `none` leaves no Maxwell branch: the whole shear modulus is elastic, nothing depends on time.
TEST(ViscousHistory, NoDamperIsTheElasticLayerOfTheSameModulus) {
  SkinParameters elastic = skin();
  elastic.relaxing_fraction = 0;
  for (int history = 0; history < kHistories; ++history) {
    const auto none = run_material_point(skin(), DamperScheme::none, program(history, 7));
    const auto reference = run_material_point(elastic, DamperScheme::exponential, program(history, 3));
    ASSERT_TRUE(none.complete && reference.complete);
    EXPECT_LT((none.states.back().piola - reference.states.back().piola).norm(), 1e-15);
    EXPECT_GT(none.states.back().piola.norm(), 1e-3);
  }
}

}  // namespace
}  // namespace rhytid
