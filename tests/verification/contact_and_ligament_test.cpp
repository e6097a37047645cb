// Surface terms against closed forms: a sphere pressed into a plane of skin points (B12), ligaments under
// uniform traction (B15), friction that creeps and slides (B14).
#include <gtest/gtest.h>

#include <cmath>

#include "loaded_problem.h"
#include "sim/element/quadrature.h"
#include "sim/surface/shapes.h"
#include "sim/terms/contact_law.h"
#include "sim/terms/geometry.h"
#include "sim/terms/ligament_law.h"

namespace rhytid::test {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// U = 2πκ (R d³/3 − d⁴/4), F = 2πκ (R d² − d³): relative errors (energy, force) on cells of size h.
std::pair<double, double> indentation_error(int cells, int degree, double offset) {
  const double radius = 8, depth = 0.5, kappa = 1;
  ExtrusionOptions o;
  o.order = 1;
  o.layers = {{1, 1, 1}};
  const SkinMesh mesh = extrude(grid_surface(8, 8, cells, cells, GridPattern::diagonal_plus), o);
  const Sphere sphere(radius);
  Term term("contact", contact_kernels(), ContactLaw{&sphere, 0.0});
  TermGroup g = surface_group(mesh, SkinSide::outer, triangle_rule(degree));
  for (int s = 0; s < 5; ++s) g.theta.push_back({ThetaSlot::Kind::constant, s, {}});
  for (double q : {1., 0., 0., 0.}) g.theta.push_back({.kind = ThetaSlot::Kind::fixed, .value = q});
  term.add_group(std::move(g));
  VectorXd native(5), force = VectorXd::Zero(3 * mesh.num_nodes());
  native << kappa, 0, offset, 0.7 * offset, radius - depth;
  TermStepData data;
  term.prepare({0, 0, 1}, native, force, nullptr, data);
  const double energy = term.energy({0, 0, 1}, data, VectorXd::Zero(force.size()), &force, nullptr);
  double total = 0;
  for (int i = 0; i < mesh.num_nodes(); ++i) total += force[3 * i + 2];
  const double u = 2 * kPi * kappa * (radius * std::pow(depth, 3) / 3 - std::pow(depth, 4) / 4),
               f = 2 * kPi * kappa * (radius * depth * depth - std::pow(depth, 3));
  EXPECT_NEAR(u, 1.99622033, 1e-8);
  EXPECT_NEAR(f, 11.78097245, 1e-8);
  return {std::fabs(energy / u - 1), std::fabs(total / f - 1)};
}

TEST(Contact, SphereOnRigidPlane) {
  double worst_u[3] = {}, worst_f[3] = {};
  for (int level = 0; level < 3; ++level)
    for (double offset : {0.0, 0.13, 0.31, 0.47}) {
      const auto [u, f] = indentation_error(4 << level, 10, offset);
      worst_u[level] = std::max(worst_u[level], u);
      worst_f[level] = std::max(worst_f[level], f);
    }
  std::printf("sphere on plane, h = 2, 1, 0.5 mm: energy %.1e %.1e %.1e, force %.1e %.1e %.1e\n", worst_u[0],
              worst_u[1], worst_u[2], worst_f[0], worst_f[1], worst_f[2]);
  EXPECT_LE(worst_u[1], 1e-4);
  EXPECT_LE(worst_f[1], 1e-3);
  EXPECT_LE(worst_u[2], 1e-5);
  EXPECT_LE(worst_f[2], 1e-4);
  // C¹ edge of the contact: between h³ and h⁴ for the energy on average.
  EXPECT_GT(std::log2(worst_u[0] / worst_u[2]) / 2, 2.5);
}

/// Energy of a rigid sphere that slides over a flat mesh at a constant depth, over one cell: (largest −
/// smallest)/mean. It should be constant.
double sliding_ripple(int cells, int degree, double onset) {
  const double radius = 8, depth = 0.5, side = 16, h = side / cells;
  ExtrusionOptions o;
  o.order = 1;
  o.layers = {{1, 1, 1}};
  const SkinMesh mesh = extrude(grid_surface(side, side, cells, cells, GridPattern::diagonal_plus), o);
  const Sphere sphere(radius);
  Term term("contact", contact_kernels(), ContactLaw{&sphere, onset});
  TermGroup g = surface_group(mesh, SkinSide::outer, triangle_rule(degree));
  for (int s = 0; s < 5; ++s) g.theta.push_back({ThetaSlot::Kind::constant, s, {}});
  for (double q : {1., 0., 0., 0.}) g.theta.push_back({.kind = ThetaSlot::Kind::fixed, .value = q});
  term.add_group(std::move(g));
  double lowest = 1e300, highest = 0, sum = 0;
  constexpr int places = 24;
  for (int k = 0; k < places; ++k) {
    VectorXd native(5);
    native << 1, 0, h * k / places, 0.3 * h, radius - depth;
    const VectorXd u = VectorXd::Zero(3 * mesh.num_nodes());
    TermStepData data;
    term.prepare({0, 0, 1}, native, u, nullptr, data);
    const double energy = term.energy({0, 0, 1}, data, u, nullptr, nullptr);
    lowest = std::min(lowest, energy);
    highest = std::max(highest, energy);
    sum += energy / places;
  }
  return (highest - lowest) / sum;
}

// The ripple is the quadrature's error where the contact ends. It falls with denser points and with a softer
// onset (one more derivative), about like h³ to h⁴.
TEST(Contact, RippleOfASlidingSphereFalls) {
  double ripple[3][3];
  const std::pair<int, double> kinds[] = {{6, 0.0}, {10, 0.0}, {10, 0.2}};
  std::printf("ripple of a sliding sphere, h = 4, 2, 1 mm\n");
  for (int kind = 0; kind < 3; ++kind) {
    for (int level = 0; level < 3; ++level)
      ripple[kind][level] = sliding_ripple(4 << level, kinds[kind].first, kinds[kind].second);
    std::printf("  degree %2d, onset %.1f mm: %.1e %.1e %.1e\n", kinds[kind].first, kinds[kind].second,
                ripple[kind][0], ripple[kind][1], ripple[kind][2]);
    EXPECT_GT(std::log2(ripple[kind][0] / ripple[kind][2]) / 2, 2.5);
  }
  EXPECT_LT(ripple[1][2], ripple[0][2]);
  EXPECT_LT(ripple[2][2], ripple[1][2]);
}

/// Uniform traction f on the inner face of a free patch, uniform b: rigid displacement d with k e^(b s)
/// d/√(d²+ε²) = f; for ε → 0 stuck when f ≤ k, else d = ln(f/k)/b.
double ligament_displacement(double traction, double k, double b, double eps) {
  Scene scene = slab_scene(4, 2, 0.5, 1, 2, 2);
  scene.ligaments = LigamentScene{};
  scene.ligaments->stiffness = k;
  scene.ligaments->smoothing = eps;
  scene.ligaments->sources = {{"only", Vec3::Zero(), {}, b, 2}};
  const SceneModel m(scene);
  const VectorXd native = m.native();
  const State rest = m.model().rest_state();
  StepProblem step(m.model(), native, {0, 0, 1. / 24}, rest);
  // Consistent load of a uniform traction over the inner face.
  const SkinMesh& mesh = m.model().mesh;
  TermGroup g = surface_group(mesh, SkinSide::inner, triangle_rule(10));
  VectorXd load = VectorXd::Zero(3 * mesh.num_nodes());
  const Vec3 direction = Vec3(1, -2, 2) / 3;
  for (int e = 0; e < g.num_elements; ++e)
    for (int q = 0; q < g.num_points; ++q)
      for (int i = 0; i < g.num_nodes; ++i)
        load.segment<3>(3 * g.nodes[static_cast<std::size_t>(e * g.num_nodes + i)]) +=
            direction * traction * g.weight[static_cast<std::size_t>(e * g.num_points + q)] *
            g.node_by_row[static_cast<std::size_t>(q * g.num_nodes + i)];
  LoadedProblem problem(step, {}, load);
  VectorXd q = VectorXd::Zero(load.size());
  const MinimiserReport report = problem.solve(q, 1e-11);
  EXPECT_TRUE(report.converged()) << name(report.status);
  double lowest = 1e300, highest = -1e300;
  for (int i = 0; i < mesh.num_nodes(); ++i) {
    lowest = std::min(lowest, q.segment<3>(3 * i).dot(direction));
    highest = std::max(highest, q.segment<3>(3 * i).dot(direction));
  }
  EXPECT_LE(highest - lowest, 1e-7) << "the patch must move as a rigid body";
  return 0.5 * (lowest + highest);
}

TEST(Ligament, ThresholdAndLogarithm) {
  const double k = 5e-4, b = 3, eps = 1e-3;
  for (double ratio : {0.5, 1.5, 4.0, 20.0}) {
    const double d = ligament_displacement(ratio * k, k, b, eps);
    const double s = std::sqrt(d * d + eps * eps) - eps;
    EXPECT_NEAR(std::exp(b * s) * d / (s + eps), ratio, 1e-7 * ratio) << "the smoothed law exactly";
    if (ratio < 1) {
      EXPECT_LE(d, eps) << "stuck";
    } else {
      EXPECT_NEAR(d, std::log(ratio) / b, 1.5 * eps) << "the publication's law in the limit";
    }
  }
}

/// A point dragged by f on a plane with normal force f_n: creep speed / ε_v in stick and sliding beyond μ f_n
/// (B14).
TEST(Friction, StickCreepAndSlidingThreshold) {
  const Plane plane(Vec3::UnitZ());
  const double mu = 0.4, pressure = 0.3, slip_speed = 2, dt = 1. / 24;
  const double theta[17] = {1, 0, mu, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, rest[4] = {},
               prepared[7] = {pressure, 0, 0, 1, 0, 0, 0};
  for (const auto& [mollifier, speeds] : {std::pair{Mollifier::quintic, std::array{0.2466, 0.5, 0.7534}},
                                          {Mollifier::quadratic, std::array{0.0513, 0.2929, 0.6838}}}) {
    const FrictionLaw law{&plane, 0, slip_speed, mollifier};
    const auto force = [&](double slip) {
      const double u[3] = {slip, 0, -0.1};
      double t[3];
      law.stress<double>(u, prepared, theta, rest, dt, t);
      return t[0];
    };
    for (int k = 0; k < 3; ++k) {
      const double wanted = (k == 0 ? 0.1 : k == 1 ? 0.5 : 0.9) * mu * pressure;
      double lo = 0, hi = slip_speed * dt;
      for (int it = 0; it < 100; ++it) (force(0.5 * (lo + hi)) < wanted ? lo : hi) = 0.5 * (lo + hi);
      EXPECT_NEAR(lo / (slip_speed * dt), speeds[static_cast<std::size_t>(k)], 5.1e-5);
    }
    for (double slip : {1.0, 3.0, 100.0}) EXPECT_NEAR(force(slip * slip_speed * dt), mu * pressure, 1e-15);
  }
}

}  // namespace
}  // namespace rhytid::test
