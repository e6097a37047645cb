// Patch tests, rest state and zero modes: what every order, scheme and element shape must satisfy exactly.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/terms/kinematics.h"
#include "tests/support/small_scenes.h"
#include "tests/verification/distorted_mesh.h"

namespace rhytid {
namespace {

using test::distorted_mesh;
using test::kNative;
using test::kStep;
using test::skin_term;

VectorXd affine(const SkinMesh& mesh, const Mat3& f, const Vec3& shift = Vec3::Zero()) {
  VectorXd u(3 * mesh.num_nodes());
  for (int i = 0; i < mesh.num_nodes(); ++i) {
    const Vec3 x = mesh.rest.row(i).transpose();
    u.segment<3>(3 * i) = (f - Mat3::Identity()) * x + shift;
  }
  return u;
}

Mat3 piola(const Mat3& f, const double* sigma) {
  Mat3 s;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) s(i, j) = i == j ? 2 * sigma[i] : sigma[kSym[i][j]];
  return f * s;
}

TEST(Patch, AffineStatesAreInEquilibriumForEveryOrder) {
  Mat3 f_old, f;
  f_old << 1.1, 0.05, -0.1, 0.02, 0.95, 0.04, 0.1, -0.03, 1.02;
  f << 1.25, 0.2, -0.15, -0.05, 0.85, 0.1, 0.12, 0.07, 0.98;
  double worst_force = 0, worst_virial = 0, worst_history = 0;
  for (int p = 1; p <= 4; ++p)
    for (int q = 1; q <= 4; ++q)
      for (bool composite : {false, true})
        for (bool bent : {false, true}) {
          SCOPED_TRACE("p " + std::to_string(p) + " q " + std::to_string(q) +
                       (composite ? " composite" : " stacked") + (bent ? " bent" : " flat"));
          const SkinMesh mesh = distorted_mesh(p, q, composite, bent);
          const Term term = skin_term(mesh);
          const VectorXd u_old = affine(mesh, f_old), u = affine(mesh, f);
          VectorXd history = VectorXd::Zero(static_cast<Eigen::Index>(term.history_size())), next = history;
          TermStepData data;
          term.prepare(kStep, kNative, u_old, history.data(), data);
          VectorXd r = VectorXd::Zero(u.size()), scale = r;
          const double energy = term.energy(kStep, data, u, &r, &scale);
          term.update(kStep, data, u, next.data());
          // The same step at one material point.
          double y_old[6], y[6], prepared[6], sigma[6], expected[6];
          const Mat3 h_old = (f_old - Mat3::Identity()).transpose(), h = (f - Mat3::Identity()).transpose();
          PrismKinematics::strain(h_old.data(), y_old);  // column-major transpose = row-major
          PrismKinematics::strain(h.data(), y);
          const double zero[6] = {};
          const SkinLaw law{DamperScheme::exponential};
          law.prepare<double>(y_old, zero, kNative.data(), nullptr, kStep.dt(), prepared);
          const double psi = law.stress<double>(y, prepared, kNative.data(), nullptr, kStep.dt(), sigma);
          law.update<double>(y, prepared, kNative.data(), nullptr, kStep.dt(), expected);
          const Mat3 stress = piola(f, sigma);
          double volume = 0;
          for (const TermGroup& g : term.groups())
            for (double w : g.weight) volume += w;
          EXPECT_NEAR(energy, psi * volume, 1e-12 * energy);
          // Virial: Σ f ⊗ X = P V on any mesh, since ∇X = I.
          Mat3 virial = Mat3::Zero();
          for (int i = 0; i < mesh.num_nodes(); ++i) virial += r.segment<3>(3 * i) * mesh.rest.row(i);
          worst_virial = std::max(worst_virial, (virial - volume * stress).norm() / (volume * stress.norm()));
          std::vector<char> rim(static_cast<std::size_t>(mesh.num_columns), 0);
          for (int c : mesh.rim_columns) rim[static_cast<std::size_t>(c)] = 1;
          int interior = 0;
          for (int c = 0; c < mesh.num_columns; ++c)
            for (int l = 1; l + 1 < mesh.num_levels; ++l) {
              if (rim[static_cast<std::size_t>(c)]) continue;
              ++interior;
              const int i = 3 * mesh.node(c, l);
              worst_force = std::max(worst_force, r.segment<3>(i).norm() / scale.maxCoeff());
            }
          EXPECT_TRUE(interior > 0 || (composite && q == 1));
          for (Eigen::Index k = 0; k < next.size(); ++k)
            worst_history = std::max(worst_history, std::fabs(next[k] - expected[k % 6]));
        }
  std::printf("patch: interior force %.1e of the largest element force, virial %.1e, history %.1e\n",
              worst_force, worst_virial, worst_history);
  EXPECT_LE(worst_force, 1e-12);
  EXPECT_LE(worst_virial, 1e-12);
  EXPECT_LE(worst_history, 1e-12);
}

TEST(Patch, FreeElementHasExactlySixZeroModes) {
  struct Keep final : Term::MatrixSink {
    void add(const TermGroup& g, int, double* dense) override {
      if (matrix.size() == 0) matrix = Eigen::Map<MatrixXd>(dense, 3 * g.num_nodes, 3 * g.num_nodes);
    }
    MatrixXd matrix;
  };
  double worst = 0, weakest = 1;
  for (int p = 1; p <= 4; ++p)
    for (int q = 1; q <= 4; ++q) {
      SCOPED_TRACE("p " + std::to_string(p) + " q " + std::to_string(q));
      const SkinMesh mesh = distorted_mesh(p, q, true, true);
      const VectorXd u = VectorXd::Zero(3 * mesh.num_nodes());
      // Both slabs of the composite element together.
      MatrixXd sum;
      for (const MaterialSlab& slab : mesh.element_layers[0].slabs) {
        Term one("skin", skin_kernels(), SkinLaw{DamperScheme::exponential});
        TermGroup g = prism_group(mesh, 0, slab, triangle_rule(std::min(12, 2 * p + 2)), q + 1);
        for (int s = 0; s < 5; ++s) g.theta.push_back({ThetaSlot::Kind::constant, s, {}});
        one.add_group(std::move(g));
        TermStepData d;
        const VectorXd zero = VectorXd::Zero(static_cast<Eigen::Index>(one.history_size()));
        one.prepare(kStep, kNative, u, zero.data(), d);
        Keep keep;
        one.hessian(kStep, d, u, false, keep);
        sum = sum.size() ? MatrixXd(sum + keep.matrix) : keep.matrix;
      }
      const VectorXd e = Eigen::SelfAdjointEigenSolver<MatrixXd>(sum).eigenvalues();
      const double top = e[e.size() - 1];
      for (int k = 0; k < 6; ++k) worst = std::max(worst, std::fabs(e[k]) / top);
      weakest = std::min(weakest, e[6] / top);
      EXPECT_GT(e[6] / top, 1e-7);
    }
  std::printf("zero modes: largest of the six %.1e, seventh at least %.1e of the largest eigenvalue\n", worst,
              weakest);
  EXPECT_LE(worst, 1e-13);
}

/// Every feature on, nothing touching yet: the rest state is an exact equilibrium, not only to a tolerance.
TEST(RestState, ResidualIsZero) {
  for (const char* base : {R"({"shape": "plane"})", R"({"shape": "imls"})",
                           R"({"shape": "sphere", "radius": "40 mm", "centre": [0, 0, "-41 mm"]})"})
    for (const auto& [scheme, bend] : {std::pair{"stacked", 0.0}, {"composite", 0.0}, {"stacked", 30.0}}) {
      SCOPED_TRACE(std::string(base) + " " + scheme);
      Scene scene =
          parse_scene_text(test::drag_scene(3, 1, scheme), "rest.json", {std::string("/base=") + base});
      scene.skin.surface.bend_radius = bend;
      scene.skin.rim = RimCondition::free;
      for (PathKnot& k : scene.colliders[0].path) k.position[2] += 20;
      const SceneModel m(scene);
      const State rest = m.model().rest_state();
      const VectorXd native = m.native();
      StepProblem problem(m.model(), native, kStep, rest);
      const VectorXd r = problem.residual(rest.u);
      EXPECT_EQ(r.lpNorm<Eigen::Infinity>(), 0.0);
      EXPECT_EQ(problem.energy(m.model().to_unknowns(rest.u), nullptr), 0.0);
      const State next = problem.advance(rest.u);
      for (std::size_t t = 0; t < m.model().terms.size(); ++t)
        if (m.model().terms[t].name().find("skin") == 0) {
          EXPECT_EQ(next.history
                        .segment(static_cast<Eigen::Index>(m.model().history_offset(t)),
                                 static_cast<Eigen::Index>(m.model().terms[t].history_size()))
                        .lpNorm<Eigen::Infinity>(),
                    0.0);
        }
    }
}

}  // namespace
}  // namespace rhytid
