// Edges at which formulas like these become NaN or lose their digits: rest, repeated stretches, zero slip,
// zero ligament stretch, b → 0, the continued exponential, dt ≪ τ ≪ dt, the centre of a finger on a node.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "law_cases.h"

namespace rhytid::test {
namespace {

/// Energy, stress and every derivative of a step finite; returns the tangent for further checks.
template <class Law>
MatrixXd expect_finite(const Law& law, const LawState& s) {
  constexpr int ne = Law::ne, ns = Law::ns, nt = Law::ntheta, n = 2 * ne + ns + nt;
  using D = Dual<n>;
  D old[ne], h[ns + 1], theta[nt], e[ne], prepared[Law::np + 1], sigma[ne], next[ns + 1];
  int at = 0;
  for (int k = 0; k < ne; ++k) e[k] = D::variable(s.e[k], at++);
  for (int k = 0; k < ne; ++k) old[k] = D::variable(s.e_old[k], at++);
  for (int k = 0; k < ns; ++k) h[k] = D::variable(s.history[k], at++);
  for (int k = 0; k < nt; ++k) theta[k] = D::variable(s.theta[k], at++);
  law.template prepare<D>(old, h, theta, s.rest.data(), s.dt, prepared);
  const D psi = law.template stress<D>(e, prepared, theta, s.rest.data(), s.dt, sigma);
  law.template update<D>(e, prepared, theta, s.rest.data(), s.dt, next);
  const auto finite = [](const D& x) {
    bool ok = std::isfinite(x.v);
    for (double d : x.d) ok = ok && std::isfinite(d);
    return ok;
  };
  EXPECT_TRUE(finite(psi));
  for (int k = 0; k < ne; ++k) EXPECT_TRUE(finite(sigma[k])) << "stress " << k;
  for (int k = 0; k < ns; ++k) EXPECT_TRUE(finite(next[k])) << "history " << k;
  MatrixXd tangent(ne, ne);
  for (int i = 0; i < ne; ++i)
    for (int j = 0; j < ne; ++j) tangent(i, j) = sigma[i].d[j];
  return tangent;
}

VectorXd stretches(double a, double b, double c) {
  VectorXd y(6);
  y << a * a - 1, b * b - 1, c * c - 1, 0, 0, 0;
  return y;
}

TEST(LawEdges, SkinAtRestAndAtRepeatedStretches) {
  const VectorXd rest = VectorXd::Zero(6);
  VectorXd tiny = rest;
  tiny[3] = 1e-300;
  for (DamperScheme scheme :
       {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang, DamperScheme::backward_euler})
    for (const VectorXd& y :
         {rest, tiny, stretches(1.3, 1.3, 1.3), stretches(2, 2, 0.25), stretches(0.4, 2.5, 2.5),
          stretches(1 + 1e-9, 1, 1 - 1e-9), stretches(1.5, 1.5 + 1e-13, 0.5)})
      for (const VectorXd& history : {rest, stretches(1.2, 1.2, 1 / 1.44)})
        for (double r : {1e-9, 1e-4, 0.0199999, 0.02, 0.0200001, 1.0, 50.0, 1e6}) {
          LawState s;
          s.e = s.e_old = y;
          s.history = history;
          s.rest = VectorXd::Zero(1);
          s.theta = VectorXd(5);
          s.theta << 0.2, 1, 30, 0.8, s.dt / r;
          const MatrixXd tangent = expect_finite(SkinLaw{scheme}, s);
          EXPECT_LE((tangent - tangent.transpose()).norm(), 1e-12 * tangent.norm());
        }
}

/// Small strains about rest see linear elasticity: ∂σ/∂Y = ¼ (2 μ dev + 3 K vol), shear entries doubled twice
/// over.
TEST(LawEdges, SkinSmallStrainLimitIsLinearElasticity) {
  LawState s;
  s.e = s.e_old = VectorXd::Zero(6);
  s.history = VectorXd::Zero(0);
  s.rest = VectorXd::Zero(1);
  const double mu = 0.3, bulk = 7;
  for (double stiffening : {0.0, 1e-13, 1e-6, 1.0, 20.0}) {
    s.theta = Vec3(mu, stiffening, bulk);
    const MatrixXd t = expect_finite(ElasticSkinLaw{}, s);
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) {
        double expected = 0;
        if (i < 3 && j < 3) expected = 0.25 * (bulk - 2 * mu / 3 + (i == j ? 2 * mu : 0));
        if (i >= 3 && i == j) expected = mu;
        EXPECT_NEAR(t(i, j), expected, 1e-14 * bulk);
      }
  }
}

/// The three numbers of every damper against 80-bit arithmetic, and continuous in dt/τ across the series
/// switch.
TEST(LawEdges, DamperNumbers) {
  for (double r : {1e-12, 1e-8, 1e-5, 1e-3, 0.0199, 0.01999999, 0.02, 0.03, 0.5, 3.0, 40.0, 1e5}) {
    const long double x = r, alpha = std::exp(-x);
    // 1 − β and 1 − α/β by their series where the closed form would cancel even in 80 bits.
    long double post = 0, term = 1;
    for (int k = 1; k < 60; ++k) {
      term *= -x / (k + 1);
      post -= term;
    }
    if (r > 1) post = 1 + std::expm1(-x) / x;
    const long double beta = r > 1 ? -std::expm1(-x) / x : 1 - post,
                      pre = x < 1 ? x - post / beta : 1 - alpha / beta;
    const Damper<double> d = damper(DamperScheme::exponential, 1.0, r);
    // Below the switch to its relative precision; above it 1 − β is good to the rounding of 1.
    const double post_digits = r < 0.02 ? 4e-16 * static_cast<double>(post) : 2.3e-16;
    EXPECT_NEAR(d.post, static_cast<double>(post), post_digits) << "r = " << r;
    EXPECT_NEAR(d.weight, static_cast<double>(beta), 4e-16 * static_cast<double>(beta)) << "r = " << r;
    EXPECT_NEAR(d.pre, static_cast<double>(pre), r < 0.02 ? 1e-15 * static_cast<double>(pre) : 3e-16)
        << "r = " << r;
    // Nothing is lost: relaxing before, during and after multiplies to the exact decay.
    for (DamperScheme scheme : {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang}) {
      const Damper<double> s = damper(scheme, 1.0, r);
      EXPECT_NEAR((1 - s.pre) * (1 - s.post), static_cast<double>(alpha), 4e-16) << "r = " << r;
      EXPECT_NEAR(s.weight, 1 - s.post, 4e-16) << "r = " << r;
    }
    // dτ-derivative against the closed form dβ/dr = (e^−r (1 + r) − 1)/r², by series for small r.
    long double slope = 0, power = 1;  // d post/dr = Σ (−1)^k … term by term
    for (int k = 1; k < 60; ++k) {
      power *= k == 1 ? -1.0L / 2 : -x / (k + 1);
      slope -= k * power;
    }
    if (r > 1) slope = (1 - alpha * (1 + x)) / (x * x);
    const Damper<Dual<1>> dd = damper(DamperScheme::exponential, Dual<1>::variable(1.0, 0), r);
    EXPECT_NEAR(dd.post.d[0], static_cast<double>(-slope * x), 2e-13 * static_cast<double>(slope * x))
        << "r = " << r;
  }
}

TEST(LawEdges, LigamentAtZeroStretchZeroBAndBeyondTheContinuation) {
  for (double size : {0.0, 1e-200, 1e-12, 0.02, 5.0, 200.0})
    for (double b : {0.0, 1e-300, 1e-12, 0.3, 10.0, 100.0}) {
      LawState s;
      s.e = s.e_old = size * Vec3(1, 2, -2) / 3;
      s.history = VectorXd::Zero(0);
      s.rest = VectorXd::Zero(1);
      s.theta = Vec3(5e-4, 0.01, b);
      const MatrixXd tangent = expect_finite(LigamentLaw{}, s);
      const Eigen::Matrix3d t = tangent;
      EXPECT_GT(t.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0) << size << ' ' << b;
    }
  // b → 0 is the limit k s, and the force at zero stretch is k/ε per length.
  LawState s;
  s.theta = Vec3(5e-4, 0.01, 0);
  double traction[3];
  const double u[3] = {0.3, 0, 0.4}, distance = std::hypot(0.5, 0.01);
  EXPECT_NEAR(LigamentLaw{}.stress<double>(u, nullptr, s.theta.data(), nullptr, 1, traction),
              5e-4 * (distance - 0.01), 1e-18);
  EXPECT_NEAR(traction[0], 5e-4 * 0.3 / distance, 1e-18);
  // Continuous in value and force where the exponential is continued.
  const double b = 10, at = 5 + 0.01, edge = std::sqrt(at * at - 0.01 * 0.01);  // s = 5 there
  const double theta[3] = {5e-4, 0.01, b};
  double below[3], above[3];
  const double under[3] = {edge * (1 - 1e-13), 0, 0}, over[3] = {edge * (1 + 1e-13), 0, 0};
  const double e0 = LigamentLaw{}.stress<double>(under, nullptr, theta, nullptr, 1, below),
               e1 = LigamentLaw{}.stress<double>(over, nullptr, theta, nullptr, 1, above);
  EXPECT_NEAR(e0, e1, 1e-10 * e0);
  EXPECT_NEAR(below[0], above[0], 1e-10 * below[0]);
}

TEST(LawEdges, FrictionAtZeroSlip) {
  const auto choices = shapes();
  for (auto& c : friction_cases(choices))
    for (double slip : {0.0, 1e-300, 1e-170, 1e-20}) {
      LawState s = c.states[0];
      const Vec3 centre = s.theta.segment<3>(3);
      s.theta.segment<3>(6) = centre;
      s.theta.tail<4>() = s.theta.segment<4>(9);
      s.e_old = s.e;
      const Vec3 n = s.history.tail<3>();
      s.e += slip * n.unitOrthogonal();
      const MatrixXd t = expect_finite(c.law, s);
      // At zero slip the quintic is flat and the quadratic has the stiffness 2 μ f_n / (ε_v dt) in the plane.
      const double stiffness = c.law.mollifier == Mollifier::quintic ? 0 : 2 * 0.4 * 0.3 / (24.0 * s.dt);
      const Eigen::Matrix3d expected = stiffness * (Eigen::Matrix3d::Identity() - n * n.transpose());
      EXPECT_LE((t - expected).norm(), 1e-13) << c.name;
    }
}

TEST(LawEdges, FingerCentreOnANode) {
  const Sphere sphere(5);
  LawState s;
  s.rest = VectorXd::Zero(4);
  s.e = s.e_old = Vec3(1, 2, 3);
  s.history = VectorXd::Zero(4);
  s.theta = VectorXd(9);
  s.theta << 1, 0, 1, 2, 3, 1, 0, 0, 0;
  (void)expect_finite(ContactLaw{&sphere, 1e-3}, s);
  s.theta = VectorXd(17);
  s.theta << 1, 0, 0.5, 1, 2, 3, 1, 2, 3, 1, 0, 0, 0, 1, 0, 0, 0;
  s.history << 0.1, 0, 0, 1;
  (void)expect_finite(FrictionLaw{&sphere, 1e-3, 1, Mollifier::quintic}, s);
}

TEST(LawEdges, ContactJustTouchingAndOutside) {
  const Plane plane(Vec3::UnitZ());
  for (double onset : {0.0, 1e-3})
    for (double depth : {-1.0, -1e-300, 0.0, 1e-300, 1e-3}) {
      LawState s;
      s.rest = VectorXd::Zero(4);
      s.e = s.e_old = Vec3(0, 0, -depth);
      s.history = VectorXd::Zero(0);
      s.theta = VectorXd::Zero(9);
      s.theta[0] = 2;
      s.theta[5] = 1;
      const MatrixXd t = expect_finite(ContactLaw{&plane, onset}, s);
      if (depth <= 0) {
        EXPECT_EQ(t.norm(), 0);
      }
      EXPECT_LE(t.norm(), 2 * 2 * (1 + 1e-12));
    }
}

/// An IMLS surface has no support far away: free when in front of it, infeasible (rejected by the line
/// search) behind.
TEST(LawEdges, OutsideTheSupportOfABone) {
  const auto surface = bone();
  const double theta[9] = {1, 0, 0, 0, 0, 1, 0, 0, 0}, rest[4] = {};
  double traction[3];
  const double front[3] = {0, 0, 50}, behind[3] = {0, 0, -50};
  EXPECT_EQ((ContactLaw{surface.get(), 1e-3}.stress<double>(front, nullptr, theta, rest, 1, traction)), 0);
  EXPECT_EQ(traction[2], 0);
  EXPECT_TRUE(
      std::isinf(ContactLaw{surface.get(), 1e-3}.stress<double>(behind, nullptr, theta, rest, 1, traction)));
}

}  // namespace
}  // namespace rhytid::test
