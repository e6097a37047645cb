// Adjoint blocks of prisms by recording against those by dual numbers, for every law and damper.
#include <gtest/gtest.h>

#include "sim/terms/make_kernel_table.h"
#include "term_cases.h"

namespace rhytid::test {
namespace {

/// The law's kernels with the adjoint blocks that dual numbers give.
template <class Law>
KernelTable dual_table() {
  using K = PointKernel<Law, PrismKinematics>;
  KernelTable table = kernel_table<Law, PrismKinematics>();
  table.adjoint_update = [](const void* l, const ElementView& v, const double* u, const double* p,
                            const double* sb, double* ub) {
    K::adjoint_update_by_points(*static_cast<const Law*>(l), v, u, p, sb, ub);
  };
  table.adjoint_step = [](const void* l, const ElementView& v, const double* u, const double* uo,
                          const double* so, const double* p, const double* adj, const double* sb, double* uob,
                          double* sob, double* tb) {
    K::adjoint_step_by_points(*static_cast<const Law*>(l), v, u, uo, so, p, adj, sb, uob, sob, tb);
  };
  return table;
}

struct Bars {
  VectorXd u, u_old, history, native;
};

Bars bars_of(const TermCase& c) {
  TermStepData data;
  c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
  Rng rng(31);
  const VectorXd adj = uniform(rng, static_cast<int>(c.u.size()), 1),
                 s_bar = uniform(rng, static_cast<int>(c.history.size()), 1);
  Bars bars{VectorXd::Zero(c.u.size()), VectorXd::Zero(c.u.size()), VectorXd::Zero(c.history.size()),
            VectorXd::Zero(c.native.size())};
  c.term().adjoint_update(c.step, data, c.u, s_bar.data(), bars.u);
  c.term().adjoint_step(c.step, data, c.u, c.u_old, c.history.data(), adj, s_bar.data(), bars.u_old,
                        bars.history.data(), bars.native);
  return bars;
}

void expect_same(const TermCase& recorded, const TermCase& dual) {
  const Bars a = bars_of(recorded), b = bars_of(dual);
  const auto compare = [&](const VectorXd& x, const VectorXd& y, const char* what) {
    EXPECT_LE((x - y).norm(), 1e-12 * y.norm()) << recorded.name << ", " << what;
  };
  compare(a.u, b.u, "u");
  compare(a.u_old, b.u_old, "old u");
  compare(a.history, b.history, "history");
  for (Eigen::Index k = 0; k < b.native.size(); ++k)
    EXPECT_NEAR(a.native[k], b.native[k], 1e-11 * std::abs(b.native[k]) + 1e-13 * b.native.norm())
        << recorded.name << ", native " << k;
  EXPECT_GT(b.native.norm(), 0);
}

TEST(ReverseKernel, AgreesWithDualNumbersForEveryDamper) {
  const KernelTable dual = dual_table<SkinLaw>();
  for (const DamperScheme scheme : {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang,
                                    DamperScheme::backward_euler, DamperScheme::none})
    for (const int order : {1, 2, 3, 4}) {
      const double size = order < 4 ? 0.2 : 0.03;  // random ones of high order turn points nearly inside out
      expect_same(skin_case(skin_kernels(), true, scheme, order, 2, size),
                  skin_case(dual, true, scheme, order, 2, size));
    }
}

TEST(ReverseKernel, AgreesWithDualNumbersForEveryLaw) {
  const KernelTable elastic = dual_table<ElasticSkinLaw>(), volume = dual_table<VolumeLaw>(),
                    stretched = dual_table<PreStretchedLaw<SkinLaw>>(),
                    stretched_elastic = dual_table<PreStretchedLaw<ElasticSkinLaw>>();
  expect_same(skin_case(elastic_skin_kernels(), false, DamperScheme::none, 2, 2),
              skin_case(elastic, false, DamperScheme::none, 2, 2));
  expect_same(volume_case(volume_kernels(), 2, 2), volume_case(volume, 2, 2));
  expect_same(pre_stretched_case(pre_stretched_skin_kernels(), true, 2, 2),
              pre_stretched_case(stretched, true, 2, 2));
  expect_same(pre_stretched_case(pre_stretched_elastic_skin_kernels(), false, 2, 1),
              pre_stretched_case(stretched_elastic, false, 2, 1));
}

/// Rest, where eigenvalues meet and strains vanish: divided differences, no quotients of zeros.
TEST(ReverseKernel, IsRightAtRest) {
  const KernelTable dual = dual_table<SkinLaw>();
  TermCase recorded = skin_case(skin_kernels(), true, DamperScheme::exponential, 2, 2),
           reference = skin_case(dual, true, DamperScheme::exponential, 2, 2);
  for (TermCase* c : {&recorded, &reference}) {
    c->u.setZero();
    c->u_old.setZero();
    c->history.setZero();
  }
  const Bars a = bars_of(recorded), b = bars_of(reference);
  EXPECT_LE((a.u - b.u).norm(), 1e-12 * b.u.norm());
  EXPECT_LE((a.u_old - b.u_old).norm(), 1e-12 * b.u_old.norm());
  EXPECT_LE((a.history - b.history).norm(), 1e-12 * b.history.norm());
  // Stresses vanish at rest, and with them most derivatives by parameters: the scale is that of a strained state.
  const double scale =
      bars_of(skin_case(skin_kernels(), true, DamperScheme::exponential, 2, 2)).native.norm();
  EXPECT_LE((a.native - b.native).norm(), 1e-12 * scale);
}

}  // namespace
}  // namespace rhytid::test
