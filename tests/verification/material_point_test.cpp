// The material point driver against closed forms in extended precision, and its parameter derivatives by
// order.
#include "sim/terms/material_point.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "sim/core/error.h"
#include "tests/support/convergence.h"

namespace rhytid {
namespace {

Mat3 uniaxial(double stretch) {
  return Vec3(stretch, 1 / std::sqrt(stretch), 1 / std::sqrt(stretch)).asDiagonal();
}
Mat3 shear(double gamma) {
  Mat3 f = Mat3::Identity();
  f(0, 1) = gamma;
  return f;
}

MaterialProgram program(const Mat3& f, std::array<bool, 3> free, double hold) {
  MaterialProgram p = ramp_and_hold(f, 0, hold, 1. / 24);
  p.traction_free = free;
  return p;
}

/// Kirchhoff stress in principal axes (B4): τ = 2 (μ∞ e^(Cq) + μ_m w) dev e + K J (J − 1) I,
/// in long double.
struct Principal {
  long double e, nu, stiffening, fraction;
  long double stress(const long double* stretch, int i, long double maxwell) const {
    long double l[3], mean = 0, q = 0, j = 1;
    for (int k = 0; k < 3; ++k) l[k] = std::log(stretch[k]), mean += l[k] / 3, j *= stretch[k];
    for (int k = 0; k < 3; ++k) q += (l[k] - mean) * (l[k] - mean);
    const long double mu = e / (2 * (1 + nu)), bulk = e / (3 * (1 - 2 * nu));
    return 2 * mu * ((1 - fraction) * std::exp(stiffening * q) + fraction * maxwell) * (l[i] - mean) +
           bulk * j * (j - 1);
  }
  /// P11 with axes 1.. `free_from` prescribed at `stretch`, the others free and equal.
  double piola11(long double stretch, int free_from, long double maxwell, long double* volume) const {
    long double lo = 0.1L, hi = 6, s[3];
    for (int it = 0; it < 200; ++it) {
      const long double mid = (lo + hi) / 2;
      for (int k = 0; k < 3; ++k) s[k] = k < free_from ? stretch : mid;
      (stress(s, 2, maxwell) > 0 ? hi : lo) = mid;
    }
    *volume = s[0] * s[1] * s[2];
    return static_cast<double>(stress(s, 0, maxwell) / s[0]);
  }
};

TEST(MaterialPoint, PublishedClosedForms) {
  const SkinParameters p;
  const auto both = [&](const MaterialProgram& m) {
    const MaterialPointRun run = run_material_point(p, DamperScheme::exponential, m);
    EXPECT_TRUE(run.complete) << run.failure;
    return std::pair{run.states[1], run.states.back()};
  };
  const auto [u0, u1] = both(program(uniaxial(1.3), {false, true, true}, 10));
  EXPECT_NEAR(u0.piola(0, 0) * 1e6, 4122.57, 5e-3);
  EXPECT_NEAR(u1.piola(0, 0) * 1e6, 899.479, 5e-4);
  EXPECT_NEAR(u0.deformation.determinant(), 1.00533, 5e-6);
  Mat3 f = Vec3(1.3, 1.3, 0.6).asDiagonal();
  const auto [b0, b1] = both(program(f, {false, false, true}, 10));
  EXPECT_NEAR(b0.piola(0, 0) * 1e6, 8656.91, 5e-3);
  EXPECT_NEAR(b1.piola(0, 0) * 1e6, 2421.24, 5e-3);
  EXPECT_NEAR(b0.deformation.determinant(), 1.022, 5e-4);
  EXPECT_NEAR(b1.deformation.determinant(), 1.0063, 5e-5);
  f = Vec3(2, 2, 0.3).asDiagonal();
  EXPECT_NEAR(both(program(f, {false, false, true}, 0)).first.deformation.determinant(), 1.148, 5e-4);
  const auto [s0, s1] = both(program(shear(1), {}, 10));
  EXPECT_NEAR(s0.kirchhoff(0, 1) * 1e6, 6457.913, 5e-4);
  EXPECT_NEAR(s0.kirchhoff(0, 0) * 1e6, 3228.956, 1e-3);
  EXPECT_NEAR(s0.kirchhoff(1, 1) * 1e6, -3228.956, 1e-3);
}

TEST(MaterialPoint, PrincipalStretchesAgainstExtendedPrecision) {
  double worst = 0;
  for (double stretch : {0.5, 0.8, 1.05, 1.3, 1.8, 2.4})
    for (double nu : {0.3, 0.49, 0.4999})
      for (double stiffening : {0.25, 1.0, 3.0})
        for (int prescribed : {1, 2}) {
          const SkinParameters p{0.02, nu, stiffening, 0.8, 1. / 12};
          const Principal exact{0.02L, nu, stiffening, 0.8L};
          const double other = prescribed == 1 ? 1 / std::sqrt(stretch) : 1 / (stretch * stretch);
          const Mat3 f = Vec3(stretch, prescribed == 2 ? stretch : other, other).asDiagonal();
          const MaterialPointRun run = run_material_point(p, DamperScheme::exponential,
                                                          program(f, {false, prescribed == 1, true}, 10));
          ASSERT_TRUE(run.complete) << run.failure << " stretch " << stretch << " nu " << nu;
          for (const auto& [state, maxwell] : {std::pair{run.states[1], 1.0L}, {run.states.back(), 0.0L}}) {
            long double volume;
            const double expected = exact.piola11(stretch, prescribed, maxwell, &volume);
            worst = std::max(worst, std::fabs(state.piola(0, 0) / expected - 1));
            EXPECT_NEAR(state.piola(0, 0), expected, 1e-10 * std::fabs(expected));
            EXPECT_NEAR(state.deformation.determinant(), static_cast<double>(volume), 1e-12);
          }
        }
  std::printf("principal stretches: worst relative error of P11 %.1e\n", worst);
}

/// A hold relaxes the Maxwell part of the stress by exactly e^(−t/τ), whatever the step (B19).
TEST(MaterialPoint, HoldRelaxesExponentially) {
  for (DamperScheme scheme : {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang}) {
    const MaterialPointRun run = run_material_point({}, scheme, program(uniaxial(1.3), {}, 1));
    ASSERT_TRUE(run.complete);
    const double viscous0 = run.states[1].piola(0, 0);
    // Equilibrium part by itself.
    const double mu = 0.02 / 2.98, q = 1.5 * std::log(1.3) * std::log(1.3);
    const double equilibrium = 2 * 0.2 * mu * std::exp(q) * std::log(1.3) / 1.3;
    for (std::size_t i = 1; i < run.states.size(); ++i) {
      const double decay = std::exp(-(run.states[i].time - run.states[1].time) * 12);
      EXPECT_NEAR(run.states[i].piola(0, 0), equilibrium + (viscous0 - equilibrium) * decay, 1e-13) << i;
    }
  }
}

TEST(MaterialPoint, DerivativesByEveryParameterThroughHistoryAndFreeStretches) {
  MaterialProgram m;
  for (int i = 0; i <= 30; ++i) {
    const double t = i / 24.0;
    m.times.push_back(t);
    Mat3 f = Vec3(1 + 0.3 * std::sin(3 * t), 1, 1).asDiagonal();
    f(0, 1) = 0.4 * t;
    m.deformation.push_back(f);
  }
  m.traction_free = {false, true, true};
  const SkinParameters base{0.02, 0.45, 1.3, 0.7, 0.1};
  for (DamperScheme scheme : {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang}) {
    const MaterialPointRun run = run_material_point(base, scheme, m);
    ASSERT_TRUE(run.complete) << run.failure;
    for (int at : {1, 7, 30})
      for (int j = 0; j < SkinParameters::count; ++j) {
        SCOPED_TRACE(std::string(SkinParameters::names[j]) + ", step " + std::to_string(at));
        double SkinParameters::*const fields[] = {
            &SkinParameters::youngs_modulus, &SkinParameters::poissons_ratio, &SkinParameters::stiffening,
            &SkinParameters::relaxing_fraction, &SkinParameters::relaxation_time};
        const double scale = 0.02 * base.*fields[j];
        EXPECT_TRUE(test::derivative_converges(
            [&](double h) {
              SkinParameters moved = base;
              moved.*fields[j] += h * scale;
              const Mat3 p = run_material_point(moved, scheme, m).states[static_cast<std::size_t>(at)].piola;
              return VectorXd(Eigen::Map<const VectorXd>(p.data(), 9));
            },
            [&] {
              VectorXd d(9);
              for (int i = 0; i < 9; ++i)
                d[i] = run.states[static_cast<std::size_t>(at)].piola_by_parameter(3 * (i % 3) + i / 3, j) *
                       scale;
              return d;
            }(),
            1.0, 1e-10));
      }
  }
}

TEST(MaterialPoint, RefusesImpossiblePrograms) {
  MaterialProgram m;
  EXPECT_THROW(run_material_point({}, DamperScheme::literal, m), ContractError);
  m = program(shear(1), {true, true, true}, 0);
  EXPECT_THROW(run_material_point({}, DamperScheme::literal, m), ContractError);
  m = program(Vec3(-1, 1, 1).asDiagonal(), {}, 0);
  EXPECT_THROW(run_material_point({}, DamperScheme::literal, m), ContractError);
  // A stress beyond the range of a double is a stated failure, with the states before it kept.
  SkinParameters stiff;
  stiff.stiffening = 50;
  m = program(Vec3(10, 10, 0.01).asDiagonal(), {false, false, true}, 0);
  const MaterialPointRun run = run_material_point(stiff, DamperScheme::exponential, m);
  EXPECT_FALSE(run.complete);
  EXPECT_EQ(run.states.size(), 1u);
  EXPECT_FALSE(run.failure.empty());
}

}  // namespace
}  // namespace rhytid
