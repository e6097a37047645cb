// A boundary-value problem solved twice (B7): two P4 × P2 prisms, bottom held, top moved and turned, large
// strains. The other side shares no code with the simulator: polynomials in x, y, z fitted through the node
// positions, stresses in 80 bits by logarithms of series, and quadrature either at the simulator's points
// (the same discrete problem: every digit must agree) or by collapsed Gauss points of its own (what
// quadrature leaves).
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdio>

#include "loaded_problem.h"
#include "long_matrix.h"
#include "sim/element/quadrature.h"

namespace rhytid::test {
namespace {

using namespace long_matrix;

using LongVector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
using LongMatrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

/// x^i y^j z^k with i + j ≤ 4, k ≤ 2, and their slopes along x, y, z.
void monomials(const Real* x, LongVector& value, LongMatrix& slope) {
  value.resize(45), slope.resize(45, 3);
  const auto power = [](Real base, int n) { return n < 0 ? Real(0) : std::pow(base, static_cast<Real>(n)); };
  int m = 0;
  for (int i = 0; i <= 4; ++i)
    for (int j = 0; i + j <= 4; ++j)
      for (int k = 0; k <= 2; ++k, ++m) {
        const Real a = power(x[0], i), b = power(x[1], j), c = power(x[2], k);
        value[m] = a * b * c;
        slope(m, 0) = i * power(x[0], i - 1) * b * c;
        slope(m, 1) = a * j * power(x[1], j - 1) * c;
        slope(m, 2) = a * b * k * power(x[2], k - 1);
      }
}

struct LongPoint {
  Real u, v, w, weight;
};

/// ∫ over u, v ≥ 0, u + v ≤ 1, −1 ≤ w ≤ 1 by Gauss's points on a square collapsed into the triangle.
std::vector<LongPoint> collapsed_rule(int in_plane, int through) {
  std::vector<LongPoint> rule;
  for (const LinePoint& a : gauss_legendre(in_plane))
    for (const LinePoint& b : gauss_legendre(in_plane))
      for (const LinePoint& c : gauss_legendre(through)) {
        const Real s = 0.5L * (1 + a.w), t = 0.5L * (1 + b.w);
        rule.push_back({s, t * (1 - s), c.w, 0.25L * a.weight * b.weight * (1 - s) * c.weight});
      }
  return rule;
}
std::vector<LongPoint> product_rule(int degree, int through) {
  std::vector<LongPoint> rule;
  for (const TrianglePoint& p : triangle_rule(degree).points)
    for (const LinePoint& c : gauss_legendre(through))
      rule.push_back({p.u, p.v, c.w, Real(p.weight) * c.weight});
  return rule;
}

struct Answer {
  Real energy = 0;
  LongVector force;  ///< ∂U/∂q
};

/// Energy and forces of the mesh at displacements q. `maxwell` scales the Maxwell part (a first literal
/// step).
Answer independent(const SkinMesh& mesh, const LayerScene& layer, Real maxwell, const VectorXd& q,
                   const std::vector<LongPoint>& rule) {
  const Real mu = layer.youngs_modulus / (2 * (1 + Real(layer.poissons_ratio))),
             bulk = layer.youngs_modulus / (3 * (1 - 2 * Real(layer.poissons_ratio))),
             mu_inf = (1 - Real(layer.relaxing_fraction)) * mu, mu_m = maxwell * layer.relaxing_fraction * mu,
             fung = layer.stiffening;
  Answer answer;
  answer.force = LongVector::Zero(q.size());
  for (int face = 0; face < mesh.num_faces; ++face) {
    const std::vector<int> nodes = mesh.element_nodes(0, face);
    LongMatrix at_nodes(45, 45), slope;
    LongVector value;
    Real low = 1e9L, high = -1e9L;
    for (int a = 0; a < 45; ++a) {
      const Real x[3] = {mesh.rest(nodes[a], 0), mesh.rest(nodes[a], 1), mesh.rest(nodes[a], 2)};
      monomials(x, value, slope);
      at_nodes.row(a) = value.transpose();
      low = std::min(low, x[2]), high = std::max(high, x[2]);
    }
    const LongMatrix basis = at_nodes.inverse();  // column a: coefficients of node a's polynomial
    const auto& t = mesh.surface.faces[static_cast<std::size_t>(face)];
    const auto corner = [&](int k, int axis) { return Real(mesh.surface.vertices(t[k], axis)); };
    const Real area2 = (corner(1, 0) - corner(0, 0)) * (corner(2, 1) - corner(0, 1)) -
                       (corner(1, 1) - corner(0, 1)) * (corner(2, 0) - corner(0, 0));
    for (const LongPoint& p : rule) {
      Real x[3];
      for (int axis = 0; axis < 2; ++axis)
        x[axis] = (1 - p.u - p.v) * corner(0, axis) + p.u * corner(1, axis) + p.v * corner(2, axis);
      x[2] = 0.5L * (low + high) + 0.5L * p.w * (high - low);
      monomials(x, value, slope);
      const LongMatrix gradient = basis.transpose() * slope;  // [45][3]
      Matrix f = identity();
      for (int a = 0; a < 45; ++a)
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j) f[i][j] += q[3 * nodes[a] + i] * gradient(a, j);
      const Matrix c = product(transposed(f), f), log_c = logarithm(c);
      const Real volume = determinant(f), mean = trace(log_c) / 3;
      const Matrix e = scaled(sum(log_c, -mean, identity()), 0.5L);
      const Real q2 = trace(product(e, e));
      const Real weight = p.weight * area2 * 0.5L * (high - low);
      answer.energy += weight * (mu_inf / fung * std::expm1(fung * q2) + mu_m * q2 +
                                 0.5L * bulk * (volume - 1) * (volume - 1));
      const Matrix kirchhoff = sum(scaled(e, 2 * mu_inf * std::exp(fung * q2) + 2 * mu_m),
                                   bulk * volume * (volume - 1), identity());
      const Matrix stress = product(f, product(kirchhoff, inverse(c)));
      for (int a = 0; a < 45; ++a)
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            answer.force[3 * nodes[a] + i] += weight * stress[i][j] * gradient(a, j);
    }
  }
  return answer;
}

TEST(SlabProblem, SolvedAndCheckedWithoutTheSimulator) {
  for (const bool relaxing : {false, true}) {
    Scene scene = slab_scene(1, 1, 0.3, 1, 4, 2);
    scene.skin.surface.grid_pattern = "diagonal_plus";
    scene.skin.triangle_degree = 8;  // 16 points × 3
    scene.skin.thickness_points = 3;
    scene.time.damper = DamperScheme::literal;
    const LayerScene& layer = scene.skin.layers[0];
    const SceneModel m(scene);
    const SkinMesh& mesh = m.model().mesh;
    const VectorXd native = m.native();
    const State rest = m.model().rest_state();
    // A literal step of half the relaxation time from rest, or of no time.
    const double r = relaxing ? 0.5 : 1e-15;
    StepProblem step(m.model(), native, {0, 0, r * layer.relaxation_time}, rest);
    VectorXd q = VectorXd::Zero(3 * mesh.num_nodes());
    std::vector<int> held;
    std::vector<char> is_held(static_cast<std::size_t>(q.size()), 0);
    for (int i = 0; i < mesh.num_nodes(); ++i) {
      const int level = i % 3;
      if (level == 1) continue;
      for (int axis = 0; axis < 3; ++axis) held.push_back(3 * i + axis), is_held[3 * i + axis] = 1;
      const double x = mesh.rest(i, 0), y = mesh.rest(i, 1);
      if (level == 2) q.segment<3>(3 * i) = Vec3(0.12 - 0.2 * y, 0.04 + 0.2 * x, -0.06 + 0.03 * x * y);
    }
    LoadedProblem problem(step, held, VectorXd::Zero(q.size()));
    const MinimiserReport report = problem.solve(q);
    ASSERT_TRUE(report.converged()) << name(report.status);
    const VectorXd residual = step.residual(q);
    const Answer same = independent(mesh, layer, std::exp(-Real(r)), q, product_rule(8, 3)),
                 fine = independent(mesh, layer, std::exp(-Real(r)), q, collapsed_rule(14, 8));
    Real off_balance = 0, scale = 0, difference = 0;
    Eigen::Matrix<Real, 3, 1> reaction = Eigen::Matrix<Real, 3, 1>::Zero();
    for (Eigen::Index i = 0; i < q.size(); ++i) {
      scale = std::max(scale, std::fabs(same.force[i]));
      difference = std::max(difference, std::fabs(same.force[i] - residual[i]));
      if (!is_held[static_cast<std::size_t>(i)])
        off_balance = std::max(off_balance, std::fabs(same.force[i]));
      if (i / 3 % 3 == 2) reaction[i % 3] += same.force[i];
    }
    std::printf(
        "slab, alpha = %.6f: U = %.12g mJ, R = (%.12g, %.12g, %.12g) N\n  independent: energy %.1e, forces "
        "%.1e, "
        "equilibrium %.1e; quadrature of 48 points: energy %.1e\n",
        std::exp(-r), report.energy, double(reaction[0]), double(reaction[1]), double(reaction[2]),
        double(std::fabs(report.energy / same.energy - 1)), double(difference / scale),
        double(off_balance / scale), double(std::fabs(same.energy / fine.energy - 1)));
    EXPECT_LT(std::fabs(report.energy / same.energy - 1), 1e-13);
    EXPECT_LT(difference, 1e-12 * scale);
    EXPECT_LT(off_balance, 1e-9 * scale);
    EXPECT_LT(std::fabs(same.energy / fine.energy - 1), 5e-3) << "corners between held and free faces";
    EXPECT_GT(std::fabs(reaction[2]), 1e-3);
  }
}

}  // namespace
}  // namespace rhytid::test
