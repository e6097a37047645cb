// Manufactured solutions: a chosen displacement field on a slab, the body force −Div P and the traction P N
// that it needs from dual numbers, and the order at which the discrete solution approaches it.
#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "loaded_problem.h"
#include "sim/element/basis.h"
#include "sim/element/quadrature.h"
#include "sim/math/dual.h"
#include "sim/terms/skin_law.h"

namespace rhytid::test {
namespace {

using D3 = Dual<3>;

/// sin and cos of a dual number (the laws need neither).
D3 sine(const D3& a) {
  return chain(a, std::sin(a.v), std::cos(a.v));
}
D3 cosine(const D3& a) {
  return chain(a, std::cos(a.v), -std::sin(a.v));
}
double sine(double a) {
  return std::sin(a);
}
double cosine(double a) {
  return std::cos(a);
}

constexpr double kAmplitude[3] = {0.04, -0.05, 0.06},
                 kWave[3][3] = {{1.4, 0.7, 0.9}, {-0.5, 1.3, 0.7}, {0.9, -0.8, 1.3}},
                 kPhase[3] = {0.3, 0.9, -0.4};

/// u*_a = A_a sin(k_a·X + φ_a) and its gradient H_aI = A_a k_aI cos(...), row-major.
template <class T>
void exact_field(const T* x, T* u, T* h) {
  for (int a = 0; a < 3; ++a) {
    const T phase = x[0] * kWave[a][0] + x[1] * kWave[a][1] + x[2] * kWave[a][2] + kPhase[a];
    u[a] = kAmplitude[a] * sine(phase);
    for (int i = 0; i < 3; ++i) h[3 * a + i] = (kAmplitude[a] * kWave[a][i]) * cosine(phase);
  }
}

/// P(I + H*), row-major.
template <class T>
void exact_piola(const T* x, const double* theta, T* p) {
  T u[3], h[9], y[6], sigma[6], th[3] = {T(theta[0]), T(theta[1]), T(theta[2])};
  exact_field(x, u, h);
  for (int c = 0; c < 6; ++c) {
    const int k = kSymRow[c], l = kSymCol[c];
    y[c] = h[3 * k + l] + h[3 * l + k] + h[k] * h[l] + h[3 + k] * h[3 + l] + h[6 + k] * h[6 + l];
  }
  (void)ElasticSkinLaw{}.stress<T>(y, nullptr, th, nullptr, 1, sigma);
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 3; ++i) {
      p[3 * a + i] = T(0.0);
      for (int k = 0; k < 3; ++k) {
        const T s = k == i ? 2.0 * sigma[i] : sigma[kSym[k][i]];
        p[3 * a + i] += (h[3 * a + k] + (a == k ? 1.0 : 0.0)) * s;
      }
    }
}

/// Calls visit(X, weight, nodes, values) at quadrature points of the volume (side 0) or the outer face (side
/// 1).
template <class Visit>
void over_points(const SkinMesh& mesh, bool outer_face, const Visit& visit) {
  const TriangleBasis triangle(mesh.order);
  const TriangleRule& rule = triangle_rule(12);
  std::vector<double> in_plane(static_cast<std::size_t>(triangle.num_nodes())), du = in_plane, dv = in_plane;
  for (int layer = 0; layer < static_cast<int>(mesh.element_layers.size()); ++layer) {
    const LineBasis line(mesh.element_layers[layer].order);
    const int n = triangle.num_nodes() * line.num_nodes();
    std::vector<double> t(static_cast<std::size_t>(line.num_nodes())), dt = t,
                                                                       values(static_cast<std::size_t>(n));
    if (outer_face && layer + 1 < static_cast<int>(mesh.element_layers.size())) continue;
    const std::vector<LinePoint> gauss = outer_face ? std::vector<LinePoint>{{1.0, 1.0}} : gauss_legendre(6);
    for (int face = 0; face < mesh.num_faces; ++face) {
      const std::vector<int> nodes = mesh.element_nodes(layer, face);
      for (const TrianglePoint& tp : rule.points)
        for (const LinePoint& lp : gauss) {
          triangle.evaluate(tp.u, tp.v, in_plane.data(), du.data(), dv.data());
          line.evaluate(lp.w, t.data(), dt.data());
          Mat3 jacobian = Mat3::Zero();
          Vec3 x = Vec3::Zero();
          for (int j = 0; j < triangle.num_nodes(); ++j)
            for (int k = 0; k < line.num_nodes(); ++k) {
              const int i = j * line.num_nodes() + k;
              const Vec3 node = mesh.rest.row(nodes[static_cast<std::size_t>(i)]).transpose();
              values[static_cast<std::size_t>(i)] = in_plane[j] * t[k];
              x += node * in_plane[j] * t[k];
              jacobian.col(0) += node * du[j] * t[k];
              jacobian.col(1) += node * dv[j] * t[k];
              jacobian.col(2) += node * in_plane[j] * dt[k];
            }
          const double measure =
              outer_face ? jacobian.col(0).cross(jacobian.col(1)).norm() : jacobian.determinant();
          visit(x, measure * tp.weight * lp.weight, nodes, values);
        }
    }
  }
}

double l2_error(int order, int cells) {
  Scene scene = slab_scene(1, cells, 0.5, cells / 2, order, order);
  LayerScene& layer = scene.skin.layers[0];
  layer.youngs_modulus = 1;
  layer.poissons_ratio = 0.3;
  layer.relaxing_fraction = 0;
  const SceneModel scene_model(scene);
  const Model& model = scene_model.model();
  const VectorXd native = scene_model.native();
  const State rest = model.rest_state();
  StepProblem step(model, native, {0, 0, 1}, rest);
  VectorXd load = VectorXd::Zero(3 * model.num_nodes());
  const auto add_load = [&](bool outer) {
    over_points(
        model.mesh, outer,
        [&](const Vec3& x, double weight, const std::vector<int>& nodes, const std::vector<double>& values) {
          const D3 xd[3] = {D3::variable(x[0], 0), D3::variable(x[1], 1), D3::variable(x[2], 2)};
          D3 p[9];
          exact_piola(xd, native.data(), p);
          for (int a = 0; a < 3; ++a) {
            const double f =
                outer ? p[3 * a + 2].v : -(p[3 * a].d[0] + p[3 * a + 1].d[1] + p[3 * a + 2].d[2]);
            for (std::size_t i = 0; i < nodes.size(); ++i) load[3 * nodes[i] + a] += weight * f * values[i];
          }
        });
  };
  add_load(false);
  add_load(true);
  // Prescribed on the rim and the inner face, traction on the outer face.
  VectorXd q = VectorXd::Zero(3 * model.num_nodes());
  std::vector<char> is_held(static_cast<std::size_t>(model.num_nodes()), 0);
  for (int c = 0; c < model.mesh.num_columns; ++c)
    is_held[static_cast<std::size_t>(model.mesh.node(c, 0))] = 1;
  for (int c : model.mesh.rim_columns)
    for (int l = 0; l < model.mesh.num_levels; ++l)
      is_held[static_cast<std::size_t>(model.mesh.node(c, l))] = 1;
  std::vector<int> held;
  for (int i = 0; i < model.num_nodes(); ++i) {
    const double x[3] = {model.mesh.rest(i, 0), model.mesh.rest(i, 1), model.mesh.rest(i, 2)};
    double u[3], h[9];
    exact_field(x, u, h);
    // All nodes start at the exact field; the discrete solution then moves away from it by its error.
    for (int a = 0; a < 3; ++a) {
      q[3 * i + a] = u[a];
      if (is_held[static_cast<std::size_t>(i)]) held.push_back(3 * i + a);
    }
  }
  LoadedProblem problem(step, held, load);
  const MinimiserReport report = problem.solve(q);
  EXPECT_TRUE(report.converged()) << name(report.status);
  double error = 0, size = 0;
  over_points(
      model.mesh, false,
      [&](const Vec3& x, double weight, const std::vector<int>& nodes, const std::vector<double>& values) {
        double u[3], h[9];
        exact_field(x.data(), u, h);
        for (int a = 0; a < 3; ++a) {
          double uh = 0;
          for (std::size_t i = 0; i < nodes.size(); ++i) uh += values[i] * q[3 * nodes[i] + a];
          error += weight * (uh - u[a]) * (uh - u[a]);
          size += weight * u[a] * u[a];
        }
      });
  return std::sqrt(error / size);
}

void check_order(int order, int coarse, int fine) {
  const double e1 = l2_error(order, coarse), e2 = l2_error(order, fine);
  const double rate = std::log(e1 / e2) / std::log(static_cast<double>(fine) / coarse);
  std::printf("p = q = %d: L2 error %.3e (%d cells) -> %.3e (%d cells), order %.2f\n", order, e1, coarse, e2,
              fine, rate);
  EXPECT_GE(rate, order + 1 - 0.1);
  EXPECT_LE(rate, order + 1 + 0.6) << "faster than theory: the test measures something else";
}

TEST(Manufactured, LinearElements) {
  check_order(1, 8, 16);
}
TEST(Manufactured, QuadraticElements) {
  check_order(2, 4, 8);
}
TEST(Manufactured, CubicElements) {
  check_order(3, 2, 4);
}
TEST(Manufactured, QuarticElements) {
  check_order(4, 2, 4);
}

}  // namespace
}  // namespace rhytid::test
