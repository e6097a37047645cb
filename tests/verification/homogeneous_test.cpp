// Boundary-value problems with homogeneous solutions, and energy identities of the viscous step.
#include <gtest/gtest.h>

#include <cmath>

#include "loaded_problem.h"
#include "sim/scene/names.h"
#include "sim/terms/kinematics.h"
#include "sim/terms/skin_law.h"

namespace rhytid::test {
namespace {

enum class Load { uniaxial, equibiaxial, shear };

struct Measured {
  double stress;  ///< of the loaded face, force over rest area, MPa
  double volume;  ///< J
};

/// A 1 × 1 × 1 mm block of two prisms (p = 2, q = 2) on rollers; dt and damper choose instantaneous or
/// relaxed.
Measured block(Load test, double amount, double dt) {
  Scene scene = slab_scene(1, 1, 1, 1, 2, 2);
  scene.time.damper = DamperScheme::literal;
  const SceneModel m(scene);
  const Model& model = m.model();
  const VectorXd native = m.native();
  const State rest = model.rest_state();
  StepProblem step(model, native, {0, 0, dt}, rest);
  const MatrixX3& x = model.mesh.rest;
  std::vector<int> held, loaded;
  VectorXd q = VectorXd::Zero(3 * model.num_nodes());
  const auto on = [&](int i, int axis, double at) { return std::fabs(x(i, axis) - at) < 1e-12; };
  for (int i = 0; i < model.num_nodes(); ++i) {
    if (test == Load::shear) {  // every boundary node is carried along; one node inside is left free
      q[3 * i] = amount * x(i, 1);
      const bool inside =
          std::fabs(x(i, 0)) < 0.4 && std::fabs(x(i, 1)) < 0.4 && !on(i, 2, 0) && !on(i, 2, -1);
      for (int a = 0; a < 3; ++a)
        if (!inside) held.push_back(3 * i + a);
      if (inside) q[3 * i] += 0.05;
      if (on(i, 1, 0.5)) loaded.push_back(3 * i);
      continue;
    }
    if (on(i, 0, -0.5)) held.push_back(3 * i);
    if (on(i, 1, -0.5)) held.push_back(3 * i + 1);
    if (on(i, 2, -1)) held.push_back(3 * i + 2);
    if (on(i, 0, 0.5)) held.push_back(3 * i), loaded.push_back(3 * i);
    q[3 * i] = amount * (x(i, 0) + 0.5);
    if (test == Load::equibiaxial) {
      q[3 * i + 1] = amount * (x(i, 1) + 0.5);
      if (on(i, 1, 0.5)) held.push_back(3 * i + 1);
    }
  }
  LoadedProblem problem(step, held, VectorXd::Zero(q.size()));
  const MinimiserReport report = problem.solve(q);
  EXPECT_TRUE(report.converged()) << name(report.status);
  const VectorXd r = step.residual(q);
  Measured result{0, model.terms[0].smallest_jacobian(q)};
  for (int i : loaded) result.stress += r[i];
  return result;
}

TEST(Homogeneous, UniaxialBiaxialShearAgainstClosedForm) {
  const double instant = 1e-14, relaxed = 1e6;
  Measured m = block(Load::uniaxial, 0.3, instant);
  EXPECT_NEAR(m.stress * 1e6, 4122.57, 5e-3);
  EXPECT_NEAR(m.volume, 1.00533, 5e-6);
  EXPECT_NEAR(block(Load::uniaxial, 0.3, relaxed).stress * 1e6, 899.479, 5e-4);
  m = block(Load::equibiaxial, 0.3, instant);
  EXPECT_NEAR(m.stress * 1e6, 8656.91, 5e-3);
  EXPECT_NEAR(m.volume, 1.022, 5e-4);
  m = block(Load::equibiaxial, 0.3, relaxed);
  EXPECT_NEAR(m.stress * 1e6, 2421.24, 5e-3);
  EXPECT_NEAR(m.volume, 1.0063, 5e-5);
  EXPECT_NEAR(block(Load::equibiaxial, 1.0, instant).volume, 1.148, 5e-4);
  // P12 = τ12 in simple shear.
  EXPECT_NEAR(block(Load::shear, 1, instant).stress * 1e6, 6457.913, 5e-4);
}

/// q_e of (C, C^v) through the law: energy with unit μ_m and nothing else.
double maxwell_energy(const double* y, const double* history) {
  const double theta[5] = {0, 0, 0, 1, 1};
  double sigma[6];
  return SkinLaw{DamperScheme::none}.stress<double>(y, history, theta, nullptr, 1, sigma);
}

TEST(Dissipation, StoredEnergyAfterAStepIsWeightSquaredTimesTrial) {
  double worst = 0, worst_loss = 0;
  for (DamperScheme scheme :
       {DamperScheme::literal, DamperScheme::exponential, DamperScheme::strang, DamperScheme::backward_euler})
    for (double tau : {1e-3, 0.05, 3.0}) {
      const double theta[5] = {0.2, 1, 30, 0.8, tau}, dt = 1. / 24;
      const double weight = damper(scheme, tau, dt).weight;
      double history[6] = {}, y_old[6] = {};
      for (int i = 1; i <= 20; ++i) {
        const double h[9] = {0.2 * std::sin(0.4 * i),
                             0.3 * std::cos(0.3 * i) - 0.3,
                             0.02 * i,
                             0.1 * std::sin(0.7 * i),
                             0.05,
                             0,
                             -0.01 * i,
                             0.1,
                             0.1 * std::sin(0.2 * i)};
        double y[6], prepared[6], next[6];
        PrismKinematics::strain(h, y);
        const SkinLaw law{scheme};
        law.prepare<double>(y_old, history, theta, nullptr, dt, prepared);
        law.update<double>(y, prepared, theta, nullptr, dt, next);
        const double before = maxwell_energy(y, prepared), after = maxwell_energy(y, next);
        worst = std::max(worst, std::fabs(after - weight * weight * before) / before);
        EXPECT_GE(weight * before - after, -1e-16) << "dissipation";
        // The spring is let go before and after the load: its log strain shrinks by 1 − pre, then by 1 − post,
        // so what it loses is known without its states.
        const Damper<double> d = damper(scheme, tau, dt);
        const double lost = (1 - (1 - d.pre) * (1 - d.pre)) * maxwell_energy(y_old, history) +
                            (1 - (1 - d.post) * (1 - d.post)) * before,
                     told = law.dissipated(y_old, history, y, prepared, next, theta, nullptr, dt) / theta[3];
        worst_loss = std::max(worst_loss, std::fabs(told - lost) / lost);
        EXPECT_GE(told, 0);
        std::copy(next, next + 6, history);
        std::copy(y, y + 6, y_old);
      }
    }
  std::printf("stored = weight² trial: worst relative error %.1e; dissipated: %.1e\n", worst, worst_loss);
  EXPECT_LE(worst, 1e-12);
  EXPECT_LE(worst_loss, 1e-10);
}

TEST(Dissipation, HoldFallsByAlphaSquaredPerStep) {
  const double tau = 0.09, dt = 1. / 24, alpha = std::exp(-dt / tau);
  const double theta[5] = {0.2, 1, 30, 0.8, tau}, h[9] = {0.3, 0.2, 0, -0.1, 0.1, 0.1, 0, 0.05, -0.2};
  double y[6];
  PrismKinematics::strain(h, y);
  for (DamperScheme scheme : {DamperScheme::literal, DamperScheme::exponential, DamperScheme::strang}) {
    double history[6] = {}, prepared[6];
    const double start = maxwell_energy(y, history);
    for (int n = 1; n <= 12; ++n) {
      double next[6];
      SkinLaw{scheme}.prepare<double>(y, history, theta, nullptr, dt, prepared);
      SkinLaw{scheme}.update<double>(y, prepared, theta, nullptr, dt, next);
      std::copy(next, next + 6, history);
      EXPECT_NEAR(maxwell_energy(y, history) / start, std::pow(alpha, 2 * n), 1e-12 * std::pow(alpha, 2 * n));
    }
  }
}

/// A clamped patch let go from a deformed state: the stored energy never rises, at any dt/τ (B18), with every
/// damper; and what the account calls dissipated is never negative.
void expect_recovery_without_gain(DamperScheme scheme, double tau) {
  SCOPED_TRACE(std::string(to_string(scheme)) + ", tau " + std::to_string(tau));
  Scene scene = slab_scene(4, 2, 0.8, 1, 2, 2);
  scene.skin.rim = RimCondition::clamped;
  scene.time.damper = scheme;
  scene.skin.layers[0].relaxation_time = tau;
  scene.time.frames = 8;
  const SceneModel m(scene);
  const Model& model = m.model();
  const VectorXd native = m.native();
  // Held at a bump long enough for the springs to relax partly, then released.
  State bent = model.rest_state();
  for (int b = 0; b < static_cast<int>(model.constraints.block_nodes.size()); ++b)
    bent.u.segment<3>(3 * model.constraints.block_nodes[static_cast<std::size_t>(b)]) =
        Vec3(0.05, -0.02, 0.3);
  const State rest = model.rest_state();
  bent = StepProblem(model, native, {0, 0, 1. / 24}, rest).advance(bent.u);
  const auto stored = [&](const State& s) {
    // Energy of a state: a step of no duration from it.
    const StepProblem still(model, native, {0, s.time, s.time + 1e-12 * tau}, s);
    double sum = 0;
    for (double e : still.term_energies(s.u)) sum += e;
    return sum;
  };
  RunOptions options = m.run_options();
  options.account_energies = true;
  const Trajectory run = simulate(model, native, options, {}, &bent);
  ASSERT_TRUE(run.complete) << run.failure;
  const double start = stored(bent);
  double before = start, dissipated = 0;
  EXPECT_GT(before, 0);
  for (const StepRecord& step : run.steps) {
    const double now = stored(step.state);
    EXPECT_LE(now, before * (1 + 1e-12)) << "step " << step.step.index;
    EXPECT_NEAR(step.energies.stored, now, 1e-9 * start) << "step " << step.step.index;
    EXPECT_GE(step.energies.dissipated, -1e-15 * start) << "step " << step.step.index;
    dissipated += step.energies.dissipated;
    before = now;
  }
  EXPECT_LE(before, 0.9 * start) << "it moved";
  if (scheme == DamperScheme::none)
    EXPECT_EQ(dissipated, 0);
  else
    EXPECT_GT(dissipated, 0);
}

TEST(Dissipation, FreeRecoveryNeverGainsEnergy) {
  for (DamperScheme scheme : {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang,
                              DamperScheme::backward_euler, DamperScheme::none})
    for (double tau : {1e-3, 0.1, 100.0}) expect_recovery_without_gain(scheme, tau);
}

}  // namespace
}  // namespace rhytid::test
