// Patch tests, rigid motion, rest state and zero modes: what every order, scheme and element shape must
// satisfy exactly.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <random>

#include "sim/element/quadrature.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "sim/surface/shapes.h"
#include "sim/terms/contact_law.h"
#include "sim/terms/geometry.h"
#include "sim/terms/skin_law.h"
#include "tests/support/small_scenes.h"

namespace rhytid {
namespace {

/// Two material layers of one material, 2 × 2 cells; fibres stay straight, so that the default rules
/// integrate the patch test exactly also on curved elements.
SkinMesh distorted_mesh(int p, int q, bool composite, bool bent) {
  ExtrusionOptions o;
  o.order = p;
  o.layers = {{0.5, 1, q}, {0.3, 1, q}};
  o.composite = composite;
  o.composite_order = q;
  if (bent) o.bend_radius = 3;
  SkinMesh mesh = extrude(grid_surface(2, 2, 2, 2, GridPattern::union_jack), o);
  std::mt19937 rng(static_cast<unsigned>(10 * p + q));
  std::uniform_real_distribution<double> d(-0.1 / (p * p), 0.1 / (p * p));
  for (int c = 0; c < mesh.num_columns; ++c) {
    const int bottom = mesh.node(c, 0), top = mesh.node(c, mesh.num_levels - 1);
    const Vec3 low = mesh.rest.row(bottom), high = mesh.rest.row(top);
    Vec3 new_low = low, new_high = high;
    for (int a = 0; a < 3; ++a) new_low[a] += d(rng), new_high[a] += d(rng);
    for (int l = 0; l < mesh.num_levels; ++l) {
      const Vec3 x = mesh.rest.row(mesh.node(c, l));
      const double s = (x - low).norm() / (high - low).norm();
      mesh.rest.row(mesh.node(c, l)) = (1 - s) * new_low + s * new_high;
    }
  }
  return mesh;
}

Term skin_term(const SkinMesh& mesh, DamperScheme scheme) {
  Term term("skin", skin_kernels(), SkinLaw{scheme});
  for (int layer = 0; layer < static_cast<int>(mesh.element_layers.size()); ++layer)
    for (const MaterialSlab& slab : mesh.element_layers[layer].slabs) {
      TermGroup g = prism_group(mesh, layer, slab, triangle_rule(std::min(12, 2 * mesh.order + 2)),
                                mesh.element_layers[layer].order + 1);
      for (int s = 0; s < 5; ++s) g.theta.push_back({ThetaSlot::Kind::constant, s, {}});
      term.add_group(std::move(g));
    }
  return term;
}

const VectorXd kNative = (VectorXd(5) << 0.2, 1.1, 6, 0.8, 0.07).finished();
const StepInfo kStep{0, 0, 1. / 24};

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
          const Term term = skin_term(mesh, DamperScheme::exponential);
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
      const Term term = skin_term(mesh, DamperScheme::exponential);
      const VectorXd u = VectorXd::Zero(3 * mesh.num_nodes());
      const VectorXd history = VectorXd::Zero(static_cast<Eigen::Index>(term.history_size()));
      TermStepData data;
      term.prepare(kStep, kNative, u, history.data(), data);
      // Both slabs of the composite element together.
      Term all("skin", skin_kernels(), SkinLaw{DamperScheme::exponential});
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

TEST(RigidMotion, SkinContactAndFrictionFollow) {
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> d(-1, 1);
  const SkinMesh mesh = distorted_mesh(3, 2, false, true);
  const Sphere finger(1.5);
  const int nodes = mesh.num_nodes();
  Vec3 top = Vec3::Zero();
  for (int c = 0; c < mesh.num_columns; ++c)
    if (mesh.rest(mesh.node(c, mesh.num_levels - 1), 2) > top[2])
      top = mesh.rest.row(mesh.node(c, mesh.num_levels - 1)).transpose();
  VectorXd native(5 + 24);
  const Vec3 centre = top + Vec3(0, 0, 1.2), centre_old = centre + Vec3(-0.1, 0.05, 0.02);
  const Eigen::Vector4d q_old(1, 0, 0, 0), q_now(1, 0.02, -0.01, 0.015);  // 0.05 rad in the step
  native << kNative, 0.7, 0.02, 0.5, centre_old, centre, centre, q_old, q_now, q_now;
  const auto knots = std::make_shared<KnotPath>(std::vector{0.0, kStep.t, 1.0});
  const auto surface_term = [&](bool friction) {
    TermGroup g = surface_group(mesh, SkinSide::outer, triangle_rule(10));
    for (int k = 0; k < (friction ? 3 : 2); ++k) g.theta.push_back({ThetaSlot::Kind::constant, 5 + k, {}});
    for (int old = 0; old < (friction ? 2 : 1); ++old)
      for (int a = 0; a < 3; ++a)
        g.theta.push_back({old ? ThetaSlot::Kind::path_old : ThetaSlot::Kind::path_now, 8 + a, knots});
    for (int old = 0; old < (friction ? 2 : 1); ++old)
      for (int a = 0; a < 4; ++a)
        g.theta.push_back({old ? ThetaSlot::Kind::path_old : ThetaSlot::Kind::path_now, 17 + a, knots, 4});
    Term t = friction
                 ? Term("friction", friction_kernels(), FrictionLaw{&finger, 1e-2, 2, Mollifier::quintic})
                 : Term("contact", contact_kernels(), ContactLaw{&finger, 1e-2});
    t.add_group(std::move(g));
    return t;
  };
  std::vector<Term> terms{skin_term(mesh, DamperScheme::exponential), surface_term(false),
                          surface_term(true)};
  VectorXd u_old(3 * nodes), u(3 * nodes);
  for (double& x : u_old) x = 0.01 * d(rng);
  for (Eigen::Index i = 0; i < u.size(); ++i) u[i] = u_old[i] + 0.01 * d(rng);
  for (const auto& [axis, angle, shift] : {std::tuple{Vec3(1, 2, -1), 2.9, Vec3(3, -50, 20)},
                                           {Vec3(0, 0, 1), 0.3, Vec3(0, 0, 0)},
                                           {Vec3(1, 0, 0), 0.0, Vec3(100, 0, 0)}}) {
    const Mat3 rot = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
    const auto moved = [&](const VectorXd& v) {
      VectorXd w(v.size());
      for (int i = 0; i < nodes; ++i) {
        const Vec3 x = mesh.rest.row(i).transpose();
        w.segment<3>(3 * i) = rot * (x + v.segment<3>(3 * i)) + shift - x;
      }
      return w;
    };
    VectorXd native_moved = native;
    for (int k = 0; k < 3; ++k)
      native_moved.segment<3>(8 + 3 * k) = rot * native.segment<3>(8 + 3 * k) + shift;
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, axis.normalized()));
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector4d own = native.segment<4>(17 + 4 * k);
      const Eigen::Quaterniond q = turn * Eigen::Quaterniond(own[0], own[1], own[2], own[3]);
      native_moved.segment<4>(17 + 4 * k) << q.w(), q.x(), q.y(), q.z();
    }
    for (const Term& term : terms) {
      SCOPED_TRACE(term.name() + ", angle " + std::to_string(angle));
      // The old history comes from a step that ends in u_old.
      const auto run = [&](const VectorXd& theta, const VectorXd& from, const VectorXd& to, VectorXd& force,
                           VectorXd& history) {
        const VectorXd zero = VectorXd::Zero(from.size());
        const VectorXd start = VectorXd::Zero(static_cast<Eigen::Index>(term.history_size()));
        VectorXd lag = start;
        history = start;
        TermStepData data;
        const StepInfo before{0, -kStep.t, 0};
        term.prepare(before, theta, from, start.data(), data);
        term.update(before, data, from, lag.data());
        term.prepare(kStep, theta, from, lag.data(), data);
        force = VectorXd::Zero(from.size());
        const double e = term.energy(kStep, data, to, &force, nullptr);
        term.update(kStep, data, to, history.data());
        return e;
      };
      VectorXd f, h, f_moved, h_moved;
      const double e = run(native, u_old, u, f, h),
                   e_moved = run(native_moved, moved(u_old), moved(u), f_moved, h_moved);
      EXPECT_GT(e, 0);
      EXPECT_NEAR(e_moved, e, 1e-12 * e + 1e-13 * shift.norm() * f.norm());
      VectorXd expected(f.size());
      for (int i = 0; i < nodes; ++i) expected.segment<3>(3 * i) = rot * f.segment<3>(3 * i);
      EXPECT_LE((f_moved - expected).norm(), 1e-11 * f.norm() * (1 + shift.norm() / 10));
      if (term.name() == "friction")
        for (Eigen::Index k = 0; 4 * k < h.size(); ++k)
          if (h[4 * k] > 0) h.segment<3>(4 * k + 1) = (rot * h.segment<3>(4 * k + 1)).eval();
      if (h.size() > 0) {
        EXPECT_LE((h_moved - h).lpNorm<Eigen::Infinity>(), 1e-12 * (1 + shift.norm()));
      }
    }
  }
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
