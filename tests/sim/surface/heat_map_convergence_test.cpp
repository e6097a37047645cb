// The heat map against exact solutions of one implicit step of the heat equation.
#include <gtest/gtest.h>

#include <algorithm>

#include "meshes.h"
#include "sim/surface/heat_map.h"
#include "sim/surface/heat_operator.h"

namespace rhytid {
namespace {

using testing::latitude_sphere;
using testing::Mesh;
using testing::square;

/// G = (1 − t Δ)⁻¹ θ on [0, π]² with Neumann boundary, at x, for a kernel inside the square. Cosine series;
/// the coefficient of cos(mx) cos(ny) is the Hankel transform of θ (Sonine: ∫₀¹ (1−q²)⁴ J₀(zq) q dq = 384
/// J₅(z)/z⁵) times cos(m cₓ) cos(n c_y). Terms fall like k^-7.5.
double exact_kernel(const Vec3& x, const HeatSource& source, double time) {
  const int modes = 40;
  double sum = 0;
  for (int m = 0; m <= modes; ++m)
    for (int n = 0; n <= modes; ++n) {
      const double z = source.radius * std::hypot(m, n);
      const double hankel = z == 0 ? 0.1 : 384 * std::cyl_bessel_j(5.0, z) / std::pow(z, 5);
      const double norm = (m == 0 ? 1 : 2) * (n == 0 ? 1 : 2) / (std::numbers::pi * std::numbers::pi);
      sum += norm * 2 * std::numbers::pi * source.radius * source.radius * hankel /
             (1 + time * (m * m + n * n)) * std::cos(m * source.position[0]) *
             std::cos(n * source.position[1]) * std::cos(m * x[0]) * std::cos(n * x[1]);
    }
  return sum;
}

/// Largest error of the weights at the 5 × 5 places that all meshes have as nodes.
double weight_error(const Mesh& mesh, int n, double time) {
  const std::vector<HeatSource> sources{
      {Vec3(1.0, 1.2, 0), 0.9}, {Vec3(2.2, 1.9, 0), 0.8}, {Vec3(1.1, 2.3, 0), 0.7}};
  const HeatMapWeights map = diffuse_sources(mesh.nodes, mesh.triangles, sources, time);
  double worst = 0;
  for (int j = 0; j <= n; j += n / 4)
    for (int i = 0; i <= n; i += n / 4) {
      const Eigen::Index node = j * (n + 1) + i;
      Vec3 kernel;
      for (int s = 0; s < 3; ++s)
        kernel[s] =
            exact_kernel(mesh.nodes.row(node).transpose(), sources[static_cast<std::size_t>(s)], time);
      worst =
          std::max(worst, (map.weights.row(node).transpose() - kernel / kernel.sum()).cwiseAbs().maxCoeff());
    }
  return worst;
}

TEST(HeatMapConvergence, SquareAtSecondOrder) {
  for (const double time : {0.05, 0.5}) {
    const double coarse = weight_error(square(32, std::numbers::pi), 32, time);
    const double fine = weight_error(square(64, std::numbers::pi), 64, time);
    EXPECT_NEAR(std::log2(coarse / fine), 2, 0.2) << time;
    EXPECT_LT(fine, 4e-3);
  }
}

/// The square with its inner nodes pushed along x by a smooth map that leaves the 5 × 5 places where they are
/// and with the long diagonals drawn: most triangles obtuse.
Mesh obtuse_square(int n) {
  Mesh mesh = square(n, std::numbers::pi);
  for (Eigen::Index i = 0; i < mesh.nodes.rows(); ++i) {
    const double x = mesh.nodes(i, 0), y = mesh.nodes(i, 1);
    mesh.nodes(i, 0) = x - 0.08 * std::sin(8 * x) * std::cos(y);
    mesh.nodes(i, 1) = y + 0.09 * std::sin(8 * y) * std::sin(x);
  }
  return mesh;
}

TEST(HeatMapConvergence, ObtuseMeshAtSecondOrderBecauseEdgesAreFlippedNotClamped) {
  const Mesh coarse_mesh = obtuse_square(32), fine_mesh = obtuse_square(64);
  const HeatOperator op = assemble_heat_operator(fine_mesh.nodes, fine_mesh.triangles);
  EXPECT_GT(op.num_flips, 500);
  const double coarse = weight_error(coarse_mesh, 32, 0.2), fine = weight_error(fine_mesh, 64, 0.2);
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.25);
  EXPECT_LT(fine, 2e-3);
}

TEST(HeatMapConvergence, ShearedMeshNeedsFlipsAndConverges) {
  // A plane wave cos(x) on a square whose cells are sheared inside: (1 − tΔ)⁻¹ cos x = cos
  // x/(1+t).
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const int n = 32 << k;
    Mesh mesh = square(n, std::numbers::pi);
    for (Eigen::Index i = 0; i < mesh.nodes.rows(); ++i) {
      const double x = mesh.nodes(i, 0), y = mesh.nodes(i, 1);
      mesh.nodes(i, 0) = x - 1.2 * std::sin(x) * std::sin(y) * std::sin(y) * std::cos(y);
    }
    const HeatOperator op = assemble_heat_operator(mesh.nodes, mesh.triangles);
    EXPECT_GT(op.num_flips, n);
    EXPECT_EQ(op.num_clamped, 0);
    const double time = 0.7;
    std::vector<WeightedEdge> edges = op.edges;
    for (WeightedEdge& e : edges) e.weight *= time;
    const VectorXd wave = mesh.nodes.col(0).array().cos();
    const VectorXd u = MMatrixFactor(op.mass, edges).solve(op.mass.cwiseProduct(wave));
    const VectorXd difference = u - wave / (1 + time);
    error[k] = std::sqrt(op.mass.dot(difference.cwiseAbs2()));
  }
  EXPECT_NEAR(std::log2(error[0] / error[1]), 2, 0.2);
}

TEST(HeatMapConvergence, SphereHarmonicsAtSecondOrder) {
  // (1 − tΔ)⁻¹ Y = Y / (1 + l(l+1) t): z has l = 1, x y has l = 2.
  const double time = 0.3;
  for (const int degree : {1, 2}) {
    double error[2];
    for (int k = 0; k < 2; ++k) {
      const Mesh mesh = latitude_sphere(20 << k);
      const HeatOperator op = assemble_heat_operator(mesh.nodes, mesh.triangles);
      EXPECT_EQ(op.num_clamped, 0);
      std::vector<WeightedEdge> edges = op.edges;
      for (WeightedEdge& e : edges) e.weight *= time;
      const VectorXd y = degree == 1 ? VectorXd(mesh.nodes.col(2))
                                     : VectorXd(mesh.nodes.col(0).cwiseProduct(mesh.nodes.col(1)));
      const VectorXd u = MMatrixFactor(op.mass, edges).solve(op.mass.cwiseProduct(y));
      const VectorXd difference = u - y / (1 + degree * (degree + 1) * time);
      error[k] = std::sqrt(op.mass.dot(difference.cwiseAbs2()));
    }
    EXPECT_NEAR(std::log2(error[0] / error[1]), 2, 0.15) << degree;
  }
}

TEST(HeatOperator, KeepsAreaAndIsExactOnLinearFunctions) {
  std::mt19937 random(51);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const int n = 12;
  Mesh mesh = square(n, 1);
  for (int j = 1; j < n; ++j)
    for (int i = 1; i < n; ++i)
      for (int k = 0; k < 2; ++k) mesh.nodes(j * (n + 1) + i, k) += 0.24 / n * uniform(random);
  const HeatOperator op = assemble_heat_operator(mesh.nodes, mesh.triangles);
  EXPECT_NEAR(op.mass.sum(), 1, 1e-13);
  EXPECT_GT(op.num_flips, 5);
  EXPECT_EQ(op.num_clamped, 0);
  // Dirichlet energy of a linear function is |∇u|² area for any flat triangulation, flipped or not.
  const VectorXd u = 2 * mesh.nodes.col(0) - 3 * mesh.nodes.col(1);
  double energy = 0;
  for (const WeightedEdge& e : op.edges) energy += e.weight * std::pow(u[e.i] - u[e.j], 2);
  EXPECT_NEAR(energy, 13, 1e-11);
}

}  // namespace
}  // namespace rhytid
