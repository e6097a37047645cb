// The ligament laws under traction: the exact answer of the printed law in the limit ε → 0, Fung's law by
// solving its scalar equation, derivatives by b against 80 bits.
//
//   printed law (ε = 0): stuck while t ≤ k, then d = ln(t/k)/b;  b tells nothing about a stuck point (∂d/∂b =
//   0) fung_quadratic: t = k e^(b d²) d, no threshold
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "sim/math/dual.h"
#include "sim/terms/ligament_law.h"

namespace rhytid {
namespace {

template <class Law>
double traction(const Law& law, double d, double k, double eps, double b) {
  const double u[3] = {d / 3, 2 * d / 3, -2 * d / 3}, theta[3] = {k, eps, b};
  double t[3];
  (void)law.template stress<double>(u, nullptr, theta, nullptr, 1, t);
  return std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
}

/// Displacement under traction t, by bisection.
template <class Law>
double displacement(const Law& law, double t, double k, double eps, double b) {
  double low = 0, high = 30;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (traction(law, middle, k, eps, b) < t ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

TEST(LigamentLaw, SmoothingTendsToThePrintedThresholdLaw) {
  const double k = 5e-4, b = 2;
  // t = 1.5 k: the known numbers for ε = 1e-1 .. 1e-4, and the limit ln 1.5 / 2
  const double expected[] = {0.3116, 0.2130, 0.2037, 0.2028};
  const double limit = std::log(1.5) / b;
  double eps = 0.1;
  for (const double d : expected) {
    EXPECT_NEAR(displacement(LigamentLaw{}, 1.5 * k, k, eps, b), d, 5e-5) << eps;
    eps /= 10;
  }
  double previous = 1;
  for (eps = 1e-2; eps > 1e-9; eps /= 10) {
    const double error = std::fabs(displacement(LigamentLaw{}, 1.5 * k, k, eps, b) - limit);
    EXPECT_LT(error, 1.1 * eps);
    EXPECT_LT(error, 0.2 * previous);
    previous = error;
  }
  // Below the threshold the point sticks and b cannot be seen: d and ∂d/∂b vanish with ε.
  double before = 1;
  for (eps = 1e-2; eps > 1e-9; eps /= 10) {
    const double d = displacement(LigamentLaw{}, 0.5 * k, k, eps, b);
    const double by_b = (displacement(LigamentLaw{}, 0.5 * k, k, eps, 1.01 * b) -
                         displacement(LigamentLaw{}, 0.5 * k, k, eps, 0.99 * b)) /
                        (0.02 * b);
    EXPECT_NEAR(d / eps, 0.5 / std::sqrt(0.75), 2 * eps + 1e-4);  // t = k d/√(d² + ε²)
    EXPECT_LT(std::fabs(by_b), 0.2 * eps);
    EXPECT_LT(std::fabs(by_b), 0.2 * before + 1e-12);
    before = std::fabs(by_b);
  }
}

TEST(LigamentLaw, FungSolvesItsScalarEquation) {
  for (const double b : {0.0, 0.3, 2.0, 40.0})
    for (const double t_over_k : {1e-6, 0.5, 1.5, 20.0}) {
      const double d = displacement(FungLigamentLaw{}, t_over_k * 5e-4, 5e-4, 0.01, b);
      EXPECT_NEAR(d * std::exp(b * d * d), t_over_k,
                  1e-12 * t_over_k);  // no threshold: moves at any traction
    }
  // The smoothing length is no parameter of this law.
  EXPECT_EQ(traction(FungLigamentLaw{}, 0.7, 1, 0.01, 2), traction(FungLigamentLaw{}, 0.7, 1, 0.3, 2));
}

/// (z e^z − e^z + 1)/z² in 80 bits: ∂/∂z of (e^z − 1)/z.
long double mean_slope(long double z) {
  if (z > 0.5L) return (z * std::exp(z) - std::expm1(z)) / (z * z);
  long double total = 0, term = 0.5L;  // Σ zⁿ/(n! (n + 2))
  for (int n = 0; n < 40; ++n) {
    total += term;
    term *= z / (n + 1) * (n + 2) / (n + 3);
  }
  return total;
}

TEST(LigamentLaw, DerivativeByBKeepsItsDigits) {
  double worst[2] = {0, 0};
  for (double z = 1e-12; z < 49; z *= 3.7)
    for (const double d : {0.01, 0.5, 3.0})
      for (const bool fung : {false, true}) {
        const double k = 5e-4, eps = 1e-3;
        const double s = fung ? d * d : d * d / (std::sqrt(d * d + eps * eps) + eps);
        using D = Dual<1>;
        const D u[3] = {D(d), D(0.0), D(0.0)}, theta[3] = {D(k), D(eps), D::variable(z / s, 0)};
        D t[3];
        const D psi = fung ? FungLigamentLaw{}.stress<D>(u, nullptr, theta, nullptr, 1, t)
                           : LigamentLaw{}.stress<D>(u, nullptr, theta, nullptr, 1, t);
        const long double sl = s, exact = (fung ? 0.5L : 1.0L) * k * sl * sl * mean_slope(sl * (z / s));
        worst[fung] = std::max(worst[fung], std::fabs(psi.d[0] / static_cast<double>(exact) - 1));
      }
  std::printf("largest relative error of ∂Ψ/∂b, b s from 1e-12 to 49: %.1e, fung %.1e\n", worst[0], worst[1]);
  EXPECT_LT(worst[0], 1e-11);
  EXPECT_LT(worst[1], 1e-11);
}

TEST(LigamentLaw, ContinuationIsFiniteAndContinuousForBothLaws) {
  for (const bool fung : {false, true}) {
    const double b = 10, k = 1, eps = 0.01;
    const double edge = fung ? std::sqrt(5.0) : std::sqrt(5.01 * 5.01 - eps * eps);
    const auto at = [&](double d) {
      return fung ? traction(FungLigamentLaw{}, d, k, eps, b) : traction(LigamentLaw{}, d, k, eps, b);
    };
    EXPECT_NEAR(at(edge * (1 + 1e-13)) / at(edge * (1 - 1e-13)), 1, 1e-9);
    const double below = (at(edge) - at(edge * (1 - 1e-7))) / (edge * 1e-7);
    const double above = (at(edge * (1 + 1e-7)) - at(edge)) / (edge * 1e-7);
    EXPECT_NEAR(above / below, 1, 1e-4);  // the stiffness too
    EXPECT_TRUE(std::isfinite(at(1e6)));
  }
}

}  // namespace
}  // namespace rhytid
