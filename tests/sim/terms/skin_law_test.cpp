// The skin law at a point: closed forms, derivative consistency, history identities, order of the dampers.
#include "sim/terms/skin_law.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "sim/core/types.h"

namespace rhytid {
namespace {

constexpr DamperScheme kSchemes[] = {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang,
                                     DamperScheme::backward_euler};

struct Moduli {
  double mu, bulk;
};
Moduli moduli(double e, double nu) {
  return {e / (2 * (1 + nu)), e / (3 * (1 - 2 * nu))};
}

Mat3 random_f(std::mt19937& rng, double amount) {
  std::uniform_real_distribution<double> d(-amount, amount);
  Mat3 f = Mat3::Identity();
  for (int i = 0; i < 9; ++i) f(i / 3, i % 3) += d(rng);
  return f;
}

void strain(const Mat3& f, double* y) {
  const Mat3 h = f - Mat3::Identity(), c = h + h.transpose() + h.transpose() * h;
  for (int k = 0; k < 6; ++k) y[k] = c(kSymRow[k], kSymCol[k]);
}

/// First Piola stress from σ = ∂ψ/∂Y.
Mat3 piola(const Mat3& f, const double* sigma) {
  Mat3 s;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) s(i, j) = i == j ? 2 * sigma[i] : sigma[kSym[i][j]];
  return f * s;
}

/// P(F) at C^v = I with the Maxwell weight given through tau → ∞ (weight 1) or mu_m = 0.
Mat3 stress_at(const Mat3& f, double e, double nu, double maxwell_share) {
  const Moduli m = moduli(e, nu);
  const double theta[5] = {0.2 * m.mu, 1, m.bulk, maxwell_share * m.mu, 1e12};
  const double prepared[6] = {};
  double y[6], sigma[6];
  strain(f, y);
  SkinLaw law{DamperScheme::literal};
  law.stress<double>(y, prepared, theta, nullptr, 1e-6, sigma);
  return piola(f, sigma);
}

/// Lateral stretch that makes P(free, free) vanish, by bisection-safeguarded secant in extended range.
template <class Deformation>
double traction_free(const Deformation& f_of, int free, double e, double nu, double share) {
  double lo = 0.5, hi = 1.5;
  for (int it = 0; it < 200; ++it) {
    const double mid = 0.5 * (lo + hi);
    (stress_at(f_of(mid), e, nu, share)(free, free) > 0 ? hi : lo) = mid;
  }
  return 0.5 * (lo + hi);
}

TEST(SkinLaw, ClosedFormUniaxialBiaxialShear) {
  const double e = 0.02, nu = 0.49;  // 20 kPa
  const auto uniaxial = [](double s) { return Mat3(Vec3(1.3, s, s).asDiagonal()); };
  const auto biaxial = [](double s) { return Mat3(Vec3(1.3, 1.3, s).asDiagonal()); };
  const double s0 = traction_free(uniaxial, 1, e, nu, 0.8), s1 = traction_free(uniaxial, 1, e, nu, 0);
  EXPECT_NEAR(stress_at(uniaxial(s0), e, nu, 0.8)(0, 0) * 1e6, 4122.57, 5e-3);
  EXPECT_NEAR(stress_at(uniaxial(s1), e, nu, 0)(0, 0) * 1e6, 899.479, 5e-4);
  EXPECT_NEAR(1.3 * s0 * s0, 1.00533, 5e-6);
  const double b0 = traction_free(biaxial, 2, e, nu, 0.8), b1 = traction_free(biaxial, 2, e, nu, 0);
  EXPECT_NEAR(stress_at(biaxial(b0), e, nu, 0.8)(0, 0) * 1e6, 8656.91, 5e-3);
  EXPECT_NEAR(stress_at(biaxial(b1), e, nu, 0)(0, 0) * 1e6, 2421.24, 5e-3);
  Mat3 shear = Mat3::Identity();
  shear(0, 1) = 1;
  const Mat3 tau = stress_at(shear, e, nu, 0.8) * shear.transpose() * 1e6;
  EXPECT_NEAR(tau(0, 1), 6457.913, 5e-4);
  EXPECT_NEAR(tau(0, 0), 3228.956, 1e-3);
  EXPECT_NEAR(tau(1, 1), -3228.956, 1e-3);
}

TEST(SkinLaw, RestIsExactlyStressFree) {
  const double theta[5] = {0.2, 1, 30, 0.8, 0.1}, zero[6] = {};
  for (DamperScheme scheme : kSchemes) {
    double prepared[6], sigma[6], next[6];
    SkinLaw law{scheme};
    law.prepare<double>(zero, zero, theta, nullptr, 0.05, prepared);
    EXPECT_EQ(law.stress<double>(zero, prepared, theta, nullptr, 0.05, sigma), 0.0);
    law.update<double>(zero, prepared, theta, nullptr, 0.05, next);
    for (int c = 0; c < 6; ++c) {
      EXPECT_EQ(sigma[c], 0.0);
      EXPECT_EQ(next[c], 0.0);
    }
  }
}

TEST(SkinLaw, StressIsEnergyDerivativeAndTangentIsSymmetric) {
  std::mt19937 rng(7);
  for (double amount : {0.3, 0.05, 1e-4, 1e-9})
    for (int draw = 0; draw < 20; ++draw) {
      const double theta[5] = {0.2, 1.3, 30, 0.8, 0.1};
      double y[6], y_old[6], history[6], prepared[6];
      strain(random_f(rng, amount), y);
      strain(random_f(rng, amount), y_old);
      double h0[6];
      strain(random_f(rng, amount), h0);
      isochoric(h0, history);
      SkinLaw law{DamperScheme::exponential};
      law.prepare<double>(y_old, history, theta, nullptr, 0.05, prepared);
      Dual<6> yd[6], pd[6], td[5], sd[6];
      for (int c = 0; c < 6; ++c) yd[c] = Dual<6>::variable(y[c], c), pd[c] = prepared[c];
      for (int c = 0; c < 5; ++c) td[c] = theta[c];
      const Dual<6> psi = law.stress<Dual<6>>(yd, pd, td, nullptr, 0.05, sd);
      double sigma[6];
      EXPECT_DOUBLE_EQ(law.stress<double>(y, prepared, theta, nullptr, 0.05, sigma), psi.v);
      double scale = 0, tangent_scale = 0;
      for (int c = 0; c < 6; ++c) {
        scale = std::max(scale, std::fabs(sigma[c]));
        for (int k = 0; k < 6; ++k) tangent_scale = std::max(tangent_scale, std::fabs(sd[c].d[k]));
      }
      for (int c = 0; c < 6; ++c) {
        EXPECT_NEAR(psi.d[c], sigma[c], 2e-14 * scale + 1e-24) << "amount " << amount;
        for (int k = 0; k < c; ++k) EXPECT_NEAR(sd[c].d[k], sd[k].d[c], 1e-13 * tangent_scale);
      }
    }
}

/// C^v and F^v forms of the literal update agree (the publication's SVD form, written with Eigen).
TEST(SkinLaw, LiteralUpdateIsThePublicationsFvUpdate) {
  std::mt19937 rng(3);
  const double theta[5] = {0.2, 1, 30, 0.8, 1. / 12};
  const double dt = 1. / 24, alpha = std::exp(-dt / theta[4]);
  Mat3 fv = Mat3::Identity();
  double history[6] = {};
  SkinLaw law{DamperScheme::literal};
  for (int step = 0; step < 12; ++step) {
    const Mat3 f = random_f(rng, 0.25), fbar = f / std::cbrt(f.determinant());
    Eigen::JacobiSVD<Mat3> svd(fbar * fv.inverse(), Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Mat3 v = svd.matrixV();
    fv = (v * svd.singularValues().array().pow(1 - alpha).matrix().asDiagonal() * v.transpose() * fv).eval();
    double y[6], prepared[6], next[6];
    strain(f, y);
    law.prepare<double>(y, history, theta, nullptr, dt, prepared);
    law.update<double>(y, prepared, theta, nullptr, dt, next);
    std::copy(next, next + 6, history);
    const Mat3 cv = fv.transpose() * fv;
    for (int c = 0; c < 6; ++c)
      EXPECT_NEAR(history[c], cv(kSymRow[c], kSymCol[c]) - (c < 3), 1e-13) << "step " << step;
  }
}

/// Non-coaxial shear with rotation to t = 1; error of the final stress against a run 64 times finer.
double history_stress(DamperScheme scheme, int steps) {
  const double theta[5] = {0, 1, 1, 0.8, 0.4};
  double history[6] = {}, y_old[6] = {}, sigma[6] = {};
  SkinLaw law{scheme};
  const double dt = 1.0 / steps;
  for (int i = 1; i <= steps; ++i) {
    const double t = i * dt;
    Mat3 f = Mat3::Identity();
    f(0, 1) = 0.8 * std::sin(2 * t);
    f(1, 0) = 0.5 * t * t;
    f(2, 0) = 0.3 * t;
    double y[6], prepared[6], next[6];
    strain(f, y);
    law.prepare<double>(y_old, history, theta, nullptr, dt, prepared);
    law.stress<double>(y, prepared, theta, nullptr, dt, sigma);
    law.update<double>(y, prepared, theta, nullptr, dt, next);
    std::copy(next, next + 6, history);
    std::copy(y, y + 6, y_old);
  }
  return sigma[3];
}

TEST(SkinLaw, DamperOrder) {
  for (DamperScheme scheme : kSchemes) {
    const double reference = history_stress(DamperScheme::strang, 20480);
    const double e1 = std::fabs(history_stress(scheme, 160) - reference),
                 e2 = std::fabs(history_stress(scheme, 320) - reference);
    const double order = std::log2(e1 / e2);
    const bool second = scheme == DamperScheme::exponential || scheme == DamperScheme::strang;
    EXPECT_NEAR(order, second ? 2.0 : 1.0, 0.1) << static_cast<int>(scheme);
  }
}

TEST(SkinLaw, MaxwellRampAgainstExact) {
  // Coaxial ramp of 0.02 log strain per step at dt/tau = 0.5 (isochoric uniaxial): elastic log strain after
  // 12 steps.
  const double tau = 2, dt = 1;
  const double theta[5] = {0, 1, 1e-9, 1, tau};
  const auto elastic_strain = [&](DamperScheme scheme) {
    double history[6] = {}, y_old[6] = {}, last = 0;
    SkinLaw law{scheme};
    for (int i = 1; i <= 12; ++i) {
      const double e = 0.02 * i;
      const double y[6] = {std::expm1(2 * e), std::expm1(-e), std::expm1(-e), 0, 0, 0};
      double prepared[6], next[6], sigma[6];
      law.prepare<double>(y_old, history, theta, nullptr, dt, prepared);
      const double psi = law.stress<double>(y, prepared, theta, nullptr, dt, sigma);
      // τ11 = 2 C11 ∂ψ/∂C11 = 2 μ_m w dev(E_trial)_11; the relaxed spring carries w E_trial
      last = 2 * (1 + y[0]) * sigma[0] / 2;
      (void)psi;
      law.update<double>(y, prepared, theta, nullptr, dt, next);
      std::copy(next, next + 6, history);
      std::copy(y, y + 6, y_old);
    }
    return last;
  };
  EXPECT_NEAR(elastic_strain(DamperScheme::exponential), 0.03990085, 5e-9);
  EXPECT_NEAR(elastic_strain(DamperScheme::literal), 0.03075346, 5e-9);
  EXPECT_NEAR(elastic_strain(DamperScheme::backward_euler), 0.03969171, 5e-9);
}

}  // namespace
}  // namespace rhytid
