// The element kernels of every term against each other and against difference quotients: gradient, Hessian,
// projection, tangent blocks, their transposes, and the instruction sets.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "prism_tables.h"
#include "term_cases.h"
#include "tests/support/convergence.h"

namespace rhytid::test {
namespace {

std::vector<TermCase> all_cases() {
  std::vector<TermCase> cases;
  cases.push_back(skin_case(skin_kernels(), true, DamperScheme::exponential, 2, 2));
  cases.push_back(skin_case(skin_kernels(), true, DamperScheme::strang, 2, 1));
  cases.push_back(skin_case(skin_kernels(), true, DamperScheme::literal, 1, 2));
  cases.push_back(skin_case(elastic_skin_kernels(), false, DamperScheme::none, 2, 3));
  cases.push_back(pre_stretched_case(pre_stretched_skin_kernels(), true, 2, 2));
  cases.push_back(pre_stretched_case(pre_stretched_elastic_skin_kernels(), false, 2, 1));
  cases.push_back(volume_case(volume_kernels(), 2, 2));
  for (const ShapeChoice& s : shapes()) {
    cases.push_back(surface_case("contact", s, 2));
    cases.push_back(surface_case("friction", s, 2, Mollifier::quintic));
    cases.push_back(surface_case("extrapolated friction", s, 2, Mollifier::quintic));
  }
  cases.push_back(surface_case("friction", shapes()[0], 3, Mollifier::quadratic));
  cases.push_back(surface_case("ligaments", shapes()[0], 3));
  cases.push_back(surface_case("fung ligaments", shapes()[0], 3));
  return cases;
}

/// Residual and new history of a step from given inputs.
struct StepOutputs {
  VectorXd residual, history;
};
StepOutputs run_step(const TermCase& c, const VectorXd& u_old, const VectorXd& history,
                     const VectorXd& native, const VectorXd& u) {
  TermStepData data;
  c.term().prepare(c.step, native, u_old, history.data(), data);
  StepOutputs out{VectorXd::Zero(u.size()), VectorXd::Zero(history.size())};
  (void)c.term().energy(c.step, data, u, &out.residual, nullptr);
  c.term().update(c.step, data, u, out.history.data());
  return out;
}

TEST(TermKernels, GradientAndHessianByOrder) {
  Rng rng(5);
  for (const TermCase& c : all_cases()) {
    SCOPED_TRACE(c.name);
    TermStepData data;
    c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
    VectorXd g = VectorXd::Zero(c.u.size());
    const double energy = c.term().energy(c.step, data, c.u, &g, nullptr);
    EXPECT_GT(energy, 0);
    EXPECT_EQ(energy, c.term().energy(c.step, data, c.u, nullptr, nullptr));
    DenseSink sink(static_cast<int>(c.u.size()));
    c.term().hessian(c.step, data, c.u, false, sink);
    EXPECT_LE((sink.matrix - sink.matrix.transpose()).norm(), 1e-14 * sink.matrix.norm());
    for (int draw = 0; draw < 3; ++draw) {
      const VectorXd d = uniform(rng, static_cast<int>(c.u.size()), 0.01);
      EXPECT_TRUE(derivative_converges(
          [&](double h) {
            VectorXd e(1);
            e[0] = c.term().energy(c.step, data, c.u + h * d, nullptr, nullptr);
            return e;
          },
          VectorXd::Constant(1, g.dot(d)), 1.0));
      EXPECT_TRUE(derivative_converges(
          [&](double h) {
            VectorXd r = VectorXd::Zero(c.u.size());
            (void)c.term().energy(c.step, data, c.u + h * d, &r, nullptr);
            return r;
          },
          sink.matrix * d, 1.0));
    }
  }
}

void expect_product_sums_are_sums_by_points(const TermCase& c) {
  Term by_points = c.term();
  for (TermGroup& g : by_points.groups()) {
    EXPECT_GT(g.product.line_points, 0);
    g.product = {};
  }
  TermStepData data;
  c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
  VectorXd g = VectorXd::Zero(c.u.size()), wanted = g;
  const double energy = c.term().energy(c.step, data, c.u, &g, nullptr);
  EXPECT_NEAR(energy, by_points.energy(c.step, data, c.u, &wanted, nullptr), 1e-14 * energy);
  EXPECT_LE((g - wanted).norm(), 1e-14 * wanted.norm());
  for (const bool projected : {false, true}) {
    DenseSink product(static_cast<int>(c.u.size())), points = product;
    c.term().hessian(c.step, data, c.u, projected, product);
    by_points.hessian(c.step, data, c.u, projected, points);
    EXPECT_LE((product.matrix - points.matrix).norm(), 1e-14 * points.matrix.norm()) << projected;
  }
}

/// Every order, since line nodes fill packs differently, and all instruction sets, whose packs differ.
TEST(TermKernels, ProductSumsAreTheSumsPointByPoint) {
  for (const PrismTables& tables : instruction_sets())
    for (int p = 1; p <= 4; ++p)
      for (int q = 1; q <= 4; ++q) {
        SCOPED_TRACE(tables.isa + ", p = " + std::to_string(p) + ", q = " + std::to_string(q));
        const double amount = p == 4 ? 0.03 : 0.1;
        expect_product_sums_are_sums_by_points(
            skin_case(tables.elastic, false, DamperScheme::exponential, p, q, amount));
      }
  expect_product_sums_are_sums_by_points(volume_case(volume_table_baseline, 2, 2));
}

TEST(TermKernels, StepsEndWhereTheFirstPointCollapses) {
  constexpr int kSamples = 400;
  Rng rng(11);
  int free = 0, limited = 0;
  for (const PrismTables& tables : instruction_sets())
    for (const auto& [p, q] : {std::pair{1, 1}, {2, 2}, {3, 3}, {4, 2}}) {
      SCOPED_TRACE(tables.isa + ", p = " + std::to_string(p) + ", q = " + std::to_string(q));
      const TermCase c =
          skin_case(tables.elastic, false, DamperScheme::exponential, p, q, p == 4 ? 0.03 : 0.1);
      for (const double amount : {0.01, 0.3, 1.0, 3.0}) {
        const VectorXd d = smooth_displacement(c.mesh, rng, amount);
        const double found = c.term().feasible_step(c.u, d);
        int first = 0;
        while (first <= kSamples && c.term().smallest_jacobian(c.u + first / double{kSamples} * d) > 0)
          ++first;
        if (std::isfinite(found)) {
          ++limited;
          EXPECT_NEAR(c.term().smallest_jacobian(c.u + found * d), 0, 1e-9);
          EXPECT_GT(c.term().smallest_jacobian(c.u + 0.999 * found * d), 0);
          EXPECT_GT(found * kSamples, first - 1);
          EXPECT_LE(found * kSamples, first + 1e-9);
        } else {
          ++free;
          EXPECT_GT(first, kSamples);
        }
      }
    }
  EXPECT_GT(free, 3);
  EXPECT_GT(limited, 3);
}

TEST(TermKernels, TangentBlocksByOrder) {
  Rng rng(6);
  constexpr int D = kDirections;
  for (const TermCase& c : all_cases()) {
    SCOPED_TRACE(c.name);
    const int nu = static_cast<int>(c.u.size()), nh = static_cast<int>(c.history.size());
    TermStepData data;
    c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
    // One direction per input group: u, old u, history, native; and one with all of them.
    MatrixXd du = MatrixXd::Zero(nu, D), du_old = du, ds = MatrixXd::Zero(nh, D);
    std::vector<VectorXd> dnative(D, VectorXd::Zero(c.native.size()));
    for (int k = 0; k < 5; ++k) {
      if (k == 0 || k == 4) du.col(k) = uniform(rng, nu, 0.01);
      if (k == 1 || k == 4) du_old.col(k) = uniform(rng, nu, 0.01);
      if (k == 2 || k == 4) ds.col(k) = uniform(rng, nh, 0.02);
      if (k == 3 || k == 4)
        dnative[k] =
            (uniform(rng, static_cast<int>(c.native.size()), 0.1).array() * c.native_scale.array()).matrix();
    }
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, D, Eigen::RowMajor>;
    const RowMajor du_rows = du, du_old_rows = du_old, ds_rows = ds;
    RowMajor df = RowMajor::Zero(nu, D), ds_new = RowMajor::Zero(nh, D);
    Term::Directions directions{D, du_rows.data(), du_old_rows.data(), ds_rows.data(), {}};
    for (const VectorXd& d : dnative) directions.dnative.push_back(&d);
    c.term().tangent(c.step, data, c.u, c.u_old, c.history.data(), directions, df.data(), ds_new.data());
    for (int k = 0; k < 5; ++k) {
      static const char* const inputs[] = {"u", "old u", "history", "native", "all"};
      SCOPED_TRACE(inputs[k]);
      const auto moved = [&](double h, bool with_u) {
        return run_step(c, c.u_old + h * du_old.col(k), c.history + h * ds.col(k), c.native + h * dnative[k],
                        c.u + (with_u ? h : 0.0) * du.col(k));
      };
      EXPECT_TRUE(derivative_converges([&](double h) { return moved(h, false).residual; }, df.col(k), 1.0));
      if (nh > 0) {
        EXPECT_TRUE(derivative_converges([&](double h) { return moved(h, true).history; }, ds_new.col(k), 1.0,
                                         1e-11));
      }
    }
  }
}

TEST(TermKernels, AdjointBlocksAreTransposesOfTangentBlocks) {
  Rng rng(7);
  constexpr int D = kDirections;
  double worst = 0;
  for (const TermCase& c : all_cases()) {
    SCOPED_TRACE(c.name);
    const int nu = static_cast<int>(c.u.size()), nh = static_cast<int>(c.history.size());
    TermStepData data;
    c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
    const VectorXd adj = uniform(rng, nu), s_bar = uniform(rng, nh);
    VectorXd u_bar = VectorXd::Zero(nu), u_old_bar = u_bar, s_old_bar = VectorXd::Zero(nh),
             native_bar = VectorXd::Zero(c.native.size());
    c.term().adjoint_update(c.step, data, c.u, s_bar.data(), u_bar);
    c.term().adjoint_step(c.step, data, c.u, c.u_old, c.history.data(), adj, s_bar.data(), u_old_bar,
                          s_old_bar.data(), native_bar);
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, D, Eigen::RowMajor>;
    RowMajor du = RowMajor::Zero(nu, D), du_old = du, ds = RowMajor::Zero(nh, D);
    std::vector<VectorXd> dnative;
    for (int k = 0; k < D; ++k) {
      const bool all = k >= 4;
      if (k == 0 || all) du.col(k) = uniform(rng, nu);
      if (k == 1 || all) du_old.col(k) = uniform(rng, nu);
      if (k == 2 || all) ds.col(k) = uniform(rng, nh);
      dnative.push_back(VectorXd::Zero(c.native.size()));
      if (k == 3 || all) dnative.back() = uniform(rng, static_cast<int>(c.native.size()));
    }
    RowMajor df = RowMajor::Zero(nu, D), ds_new = RowMajor::Zero(nh, D);
    Term::Directions directions{D, du.data(), du_old.data(), ds.data(), {}};
    for (const VectorXd& d : dnative) directions.dnative.push_back(&d);
    c.term().tangent(c.step, data, c.u, c.u_old, c.history.data(), directions, df.data(), ds_new.data());
    for (int k = 0; k < D; ++k) {
      const double force_part = -adj.dot(df.col(k)), history_part = nh > 0 ? s_bar.dot(ds_new.col(k)) : 0;
      const double backward = u_bar.dot(du.col(k)) + u_old_bar.dot(du_old.col(k)) +
                              (nh > 0 ? s_old_bar.dot(ds.col(k)) : 0) + native_bar.dot(dnative[k]);
      const double size = adj.norm() * df.col(k).norm() + s_bar.norm() * ds_new.col(k).norm();
      EXPECT_NEAR(force_part + history_part, backward, 1e-13 * size) << "direction " << k;
      if (size > 0) worst = std::max(worst, std::fabs(force_part + history_part - backward) / size);
    }
    EXPECT_GT(native_bar.norm(), 0);
    if (nh > 0) {
      EXPECT_GT(ds_new.col(3).norm(), 0) << "no parameter reaches the history: dt = 0?";
    }
    if (c.term().kernels().np > 0) {
      EXPECT_GT(u_old_bar.norm() + s_old_bar.norm(), 0);
    }
  }
  std::printf("duality of the cross blocks: worst %.1e\n", worst);
}

TEST(TermKernels, ProjectedHessianIsSemidefiniteAndEqualsRawWhenRawIs) {
  for (const TermCase& c : all_cases()) {
    SCOPED_TRACE(c.name);
    TermStepData data;
    c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
    DenseSink projected(static_cast<int>(c.u.size())), raw(static_cast<int>(c.u.size()));
    c.term().hessian(c.step, data, c.u, true, projected);
    c.term().hessian(c.step, data, c.u, false, raw);
    double raw_lowest = 0;
    for (std::size_t e = 0; e < projected.elements.size(); ++e) {
      const Eigen::SelfAdjointEigenSolver<MatrixXd> p(projected.elements[e]), r(raw.elements[e]);
      EXPECT_GE(p.eigenvalues().minCoeff(), -1e-11 * p.eigenvalues().maxCoeff());
      // Projection only ever adds stiffness.
      const Eigen::SelfAdjointEigenSolver<MatrixXd> added(projected.elements[e] - raw.elements[e]);
      EXPECT_GE(added.eigenvalues().minCoeff(), -1e-11 * p.eigenvalues().maxCoeff());
      raw_lowest = std::min(raw_lowest, r.eigenvalues().minCoeff() / r.eigenvalues().maxCoeff());
    }
    const bool convex =
        c.name.find("plane") != std::string::npos || c.name.find("ligaments") != std::string::npos;
    if (convex) {
      EXPECT_LE((projected.matrix - raw.matrix).norm(), 1e-14 * raw.matrix.norm());
    } else if (c.name.find("skin") != std::string::npos) {
      EXPECT_LT(raw_lowest, -1e-6) << "no indefinite element: the projection was not exercised";
    }
  }
  // Skin at rest has no stress, hence no geometric part: projection changes nothing but round-off.
  TermCase c = skin_case(skin_kernels(), true, DamperScheme::exponential, 2, 2);
  c.u.setZero(), c.u_old.setZero(), c.history.setZero();
  TermStepData data;
  c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
  DenseSink projected(static_cast<int>(c.u.size())), raw(static_cast<int>(c.u.size()));
  c.term().hessian(c.step, data, c.u, true, projected);
  c.term().hessian(c.step, data, c.u, false, raw);
  EXPECT_LE((projected.matrix - raw.matrix).norm(), 1e-12 * raw.matrix.norm());
}

TEST(TermKernels, InstructionSetsAgree) {
  const std::vector<PrismTables> sets = instruction_sets();
  if (sets.size() == 1) GTEST_SKIP() << "portable kernels only";
  Rng rng(8);
  constexpr int D = kDirections;
  std::vector<std::pair<TermCase, TermCase>> pairs;
  for (std::size_t k = 1; k < sets.size(); ++k) {
    const auto add = [&](auto&& make) { pairs.emplace_back(make(sets[k]), make(sets[0])); };
    for (bool viscous : {true, false}) {
      for (const auto& [p, q] : {std::pair{1, 1}, {2, 2}, {4, 3}})
        add([&, p = p, q = q](const PrismTables& t) {
          return skin_case(viscous ? t.skin : t.elastic, viscous, DamperScheme::exponential, p, q,
                           p == 4 ? 0.03 : 0.2);
        });
      add([&](const PrismTables& t) {
        return pre_stretched_case(viscous ? t.pre_stretched_skin : t.pre_stretched_elastic, viscous, 2, 2);
      });
    }
    add([](const PrismTables& t) { return volume_case(t.volume, 2, 2); });
  }
  for (const auto& [a, b] : pairs) {
    SCOPED_TRACE(a.name + ", p = " + std::to_string(a.mesh.order));
    const int nu = static_cast<int>(a.u.size()), nh = static_cast<int>(a.history.size());
    const VectorXd adj = uniform(rng, nu), s_bar = uniform(rng, nh);
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, D, Eigen::RowMajor>;
    const RowMajor du = RowMajor::Random(nu, D), ds = RowMajor::Random(nh, D);
    const VectorXd dn = uniform(rng, static_cast<int>(a.native.size()));
    std::vector<VectorXd> results[2];
    for (const TermCase* c : {&a, &b}) {
      auto& r = results[c == &b];
      TermStepData data;
      c->term().prepare(c->step, c->native, c->u_old, c->history.data(), data);
      r.push_back(
          Eigen::Map<VectorXd>(data.prepared.data(), static_cast<Eigen::Index>(data.prepared.size())));
      VectorXd g = VectorXd::Zero(nu);
      r.push_back(VectorXd::Constant(1, c->term().energy(c->step, data, c->u, &g, nullptr)));
      r.push_back(g);
      for (bool projected : {false, true}) {
        DenseSink sink(nu);
        c->term().hessian(c->step, data, c->u, projected, sink);
        r.push_back(Eigen::Map<VectorXd>(sink.matrix.data(), sink.matrix.size()));
      }
      VectorXd h = VectorXd::Zero(nh);
      c->term().update(c->step, data, c->u, h.data());
      r.push_back(h);
      RowMajor df = RowMajor::Zero(nu, D), dh = RowMajor::Zero(nh, D);
      c->term().tangent(c->step, data, c->u, c->u_old, c->history.data(),
                        {D, du.data(), du.data(), ds.data(), {&dn}}, df.data(), dh.data());
      r.push_back(Eigen::Map<VectorXd>(df.data(), df.size()));
      r.push_back(Eigen::Map<VectorXd>(dh.data(), dh.size()));
      VectorXd ub = VectorXd::Zero(nu), uob = ub, sb = VectorXd::Zero(nh),
               nb = VectorXd::Zero(a.native.size());
      c->term().adjoint_update(c->step, data, c->u, s_bar.data(), ub);
      c->term().adjoint_step(c->step, data, c->u, c->u_old, c->history.data(), adj, s_bar.data(), uob,
                             sb.data(), nb);
      for (const VectorXd& v : {ub, uob, sb, nb}) r.push_back(v);
    }
    ASSERT_TRUE(std::isfinite(results[0][1][0]));
    for (std::size_t k = 0; k < results[0].size(); ++k)
      EXPECT_LE((results[0][k] - results[1][k]).norm(), 1e-13 * results[1][k].norm() + 1e-300)
          << "result " << k << ", relative error "
          << (results[0][k] - results[1][k]).norm() / results[1][k].norm();
  }
}

}  // namespace
}  // namespace rhytid::test
