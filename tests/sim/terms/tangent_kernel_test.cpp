// Tangent blocks of skin in packs of points against those by dual numbers: every damper, order and instruction set,
// parameters that differ from point to point, states at rest and far from it.
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "prism_tables.h"
#include "sim/terms/make_kernel_table.h"
#include "term_cases.h"

namespace rhytid::test {
namespace {

constexpr int D = kDirections;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, D, Eigen::RowMajor>;

/// The law's kernels with the tangent blocks that dual numbers give.
template <class Law>
KernelTable dual_table() {
  using K = PointKernel<Law, PrismKinematics>;
  KernelTable table = kernel_table<Law, PrismKinematics>();
  table.tangent = [](const void* l, const ElementView& v, const double* u, const double* uo, const double* so,
                     const double* p, const double* du, const double* duo, const double* dso,
                     const double* dt, double* df, double* ds) {
    K::tangent_by_points(*static_cast<const Law*>(l), v, u, uo, so, p, du, duo, dso, dt, df, ds);
  };
  return table;
}

/// The law's kernels whose history advances point by point.
template <class Law>
KernelTable table_by_points() {
  using K = PointKernel<Law, PrismKinematics>;
  KernelTable table = kernel_table<Law, PrismKinematics>();
  table.prepare = [](const void* l, const ElementView& v, const double* uo, const double* so, double* p) {
    K::prepare_by_points(*static_cast<const Law*>(l), v, uo, so, p);
  };
  table.update = [](const void* l, const ElementView& v, const double* u, const double* p, double* s) {
    K::update_by_points(*static_cast<const Law*>(l), v, u, p, s);
  };
  return table;
}

/// Which directions are given, and which results are asked for.
struct Asked {
  bool du = true, du_old = true, ds_old = true, native = true, df = true, ds_new = true;
};

struct Blocks {
  RowMajor df, ds_new;
};

/// Five directions move one input each, or all, the others all of them; df is added to what is there.
Blocks blocks_of(const TermCase& c, const Asked& asked = {}) {
  TermStepData data;
  c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
  Rng rng(41);
  const int nu = static_cast<int>(c.u.size()), nh = static_cast<int>(c.history.size());
  RowMajor du = RowMajor::Zero(nu, D), du_old = du, ds = RowMajor::Zero(nh, D);
  std::vector<VectorXd> dnative(D, VectorXd::Zero(c.native.size()));
  for (int k = 0; k < D; ++k) {
    if (k == 0 || k >= 4) du.col(k) = uniform(rng, nu);
    if (k == 1 || k >= 4) du_old.col(k) = uniform(rng, nu);
    if (k == 2 || k >= 4) ds.col(k) = uniform(rng, nh);
    if (k == 3 || k >= 4)
      dnative[k] = uniform(rng, static_cast<int>(c.native.size())).cwiseProduct(c.native_scale);
  }
  Term::Directions directions{D,
                              asked.du ? du.data() : nullptr,
                              asked.du_old ? du_old.data() : nullptr,
                              asked.ds_old ? ds.data() : nullptr,
                              {}};
  if (asked.native)
    for (const VectorXd& d : dnative) directions.dnative.push_back(&d);
  Blocks out{RowMajor::Constant(nu, D, 0.5), RowMajor::Zero(nh, D)};
  c.term().tangent(c.step, data, c.u, c.u_old, c.history.data(), directions,
                   asked.df ? out.df.data() : nullptr, asked.ds_new ? out.ds_new.data() : nullptr);
  out.df.array() -= 0.5;
  return out;
}

/// Direction by direction; `worst` keeps the largest relative difference. A history that is all but forgotten is a
/// difference of numbers of the size of the others.
void expect_same(const TermCase& packed, const TermCase& dual, double& worst, const Asked& asked = {}) {
  const Blocks a = blocks_of(packed, asked), b = blocks_of(dual, asked);
  const auto compare = [&](const RowMajor& x, const RowMajor& y, const char* what, double rounding) {
    const double largest = y.colwise().norm().maxCoeff();
    for (int k = 0; k < D; ++k) {
      const double difference = (x.col(k) - y.col(k)).norm(), scale = y.col(k).norm();
      EXPECT_LE(difference, 1e-12 * scale + 1e-14 * largest + rounding)
          << packed.name << ", " << what << " along direction " << k;
      if (largest > 0) worst = std::max(worst, difference / std::max(scale, 0.01 * largest));
    }
  };
  compare(a.df, b.df, "force",
          asked.df ? 1e-16 * static_cast<double>(a.df.rows()) : 0.0);  // of sums with 0.5
  compare(a.ds_new, b.ds_new, "history", 0);
  EXPECT_GT(b.df.norm() + b.ds_new.norm(), 0);
}

constexpr DamperScheme kSchemes[] = {DamperScheme::exponential, DamperScheme::literal, DamperScheme::strang,
                                     DamperScheme::backward_euler, DamperScheme::none};

TEST(TangentKernel, AgreesWithDualNumbersForEveryDamperAndInstructionSet) {
  const KernelTable dual = dual_table<SkinLaw>(), dual_elastic = dual_table<ElasticSkinLaw>();
  for (const PrismTables& tables : instruction_sets()) {
    SCOPED_TRACE(tables.isa);
    double worst = 0;
    for (const DamperScheme scheme : kSchemes)
      for (const int order : {1, 2, 3, 4}) {
        const double size =
            order < 4 ? 0.2 : 0.03;  // random ones of high order turn points nearly inside out
        expect_same(skin_case(tables.skin, true, scheme, order, 2, size),
                    skin_case(dual, true, scheme, order, 2, size), worst);
      }
    for (const int order : {1, 2, 3, 4})
      expect_same(skin_case(tables.elastic, false, DamperScheme::none, order, 5 - order, 0.03),
                  skin_case(dual_elastic, false, DamperScheme::none, order, 5 - order, 0.03), worst);
    std::printf("%s: tangent blocks differ from dual numbers by %.1e at most\n", tables.isa.c_str(), worst);
  }
}

TEST(TangentKernel, ResultsAndDirectionsMayBeLeftOut) {
  const KernelTable dual = dual_table<SkinLaw>();
  double worst = 0;
  for (const Asked& asked : {Asked{.du = false, .ds_new = false}, Asked{.df = false}, Asked{.du_old = false},
                             Asked{.ds_old = false}, Asked{.native = false}, Asked{.du = false}})
    for (const DamperScheme scheme : {DamperScheme::exponential, DamperScheme::literal})
      expect_same(skin_case(skin_kernels(), true, scheme, 2, 2), skin_case(dual, true, scheme, 2, 2), worst,
                  asked);
  // Of an elastic layer's start nothing is felt.
  const TermCase elastic = skin_case(elastic_skin_kernels(), false, DamperScheme::none, 2, 2);
  EXPECT_EQ(blocks_of(elastic, {.native = false}).df.norm(), 0);
}

/// History far from the strain and from the identity, long and short relaxation times.
TEST(TangentKernel, AgreesFarFromRest) {
  const KernelTable dual = dual_table<SkinLaw>();
  double worst = 0;
  for (const DamperScheme scheme : kSchemes)
    for (const double tau : {1e-3, 50.0}) {
      TermCase packed = skin_case(skin_kernels(), true, scheme, 2, 2, 0.35);
      for (Eigen::Index k = 0; 6 * k < packed.history.size(); ++k) {
        // Stretches between 0.4 and 2.7 along turned axes.
        Rng rng(static_cast<unsigned>(100 + k));
        const Mat3 q = Eigen::Quaterniond(uniform(rng, 4).normalized().data()).toRotationMatrix();
        const Vec3 logs = uniform(rng, 3, 2.0);
        const Mat3 y = q * Mat3((logs.array() - logs.mean()).exp().matrix().asDiagonal()) * q.transpose() -
                       Mat3::Identity();
        for (int c = 0; c < 6; ++c) packed.history[6 * k + c] = y(kSymRow[c], kSymCol[c]);
      }
      packed.native[4] = packed.native[9] = tau;
      TermCase reference = skin_case(dual, true, scheme, 2, 2, 0.35);
      reference.history = packed.history;
      reference.native = packed.native;
      expect_same(packed, reference, worst);
    }
  std::printf("far from rest: %.1e\n", worst);
}

/// At rest all eigenvalues meet and forces vanish; close to it strains keep their digits.
TEST(TangentKernel, AgreesAtRestAndCloseToIt) {
  const KernelTable dual = dual_table<SkinLaw>();
  for (const double amount : {0.0, 1e-13, 1e-8, 1e-4}) {
    SCOPED_TRACE(amount);
    TermCase packed = skin_case(skin_kernels(), true, DamperScheme::exponential, 2, 2),
             reference = skin_case(dual, true, DamperScheme::exponential, 2, 2);
    for (TermCase* c : {&packed, &reference}) {
      c->u *= amount;
      c->u_old *= amount;
      c->history *= amount;
    }
    const Blocks a = blocks_of(packed), b = blocks_of(reference);
    for (int k = 0; k < D; ++k) {
      // Forces change with parameters alone by as much as there is strain, and that counts by itself.
      const double scale = k == 3 && amount > 0 ? b.df.col(k).norm() : b.df.norm();
      EXPECT_LE((a.df.col(k) - b.df.col(k)).norm(), 1e-12 * scale + 1e-16 * a.df.rows()) << "force " << k;
      const double history = k == 3 && amount > 0 ? b.ds_new.col(k).norm() : b.ds_new.norm();
      EXPECT_LE((a.ds_new.col(k) - b.ds_new.col(k)).norm(), 1e-12 * history) << "history " << k;
    }
    if (amount > 0) {
      EXPECT_GT(b.ds_new.col(3).norm(), 0);
    }
  }
}

/// A parameter that is a field over the columns: θ differs from point to point.
TEST(TangentKernel, AgreesWhereParametersDifferFromPointToPoint) {
  const KernelTable dual = dual_table<SkinLaw>();
  double worst = 0;
  const auto with_field = [](const KernelTable& kernels, DamperScheme scheme) {
    TermCase c = skin_case(kernels, true, scheme, 2, 2);
    Rng rng(43);
    const int columns = c.mesh.num_columns, fields = 5;
    const VectorXd scalars = c.native.head(5);
    c.native.resize(fields * columns);
    for (int s = 0; s < fields; ++s)
      c.native.segment(s * columns, columns) =
          scalars[s] * (VectorXd::Ones(columns) + uniform(rng, columns, 0.4));
    c.native_scale = c.native;
    for (TermGroup& g : c.terms.front().groups()) {
      for (int s = 0; s < fields; ++s) g.theta[s] = {ThetaSlot::Kind::field, s * columns, {}};
      const std::size_t points = static_cast<std::size_t>(g.num_elements) * g.num_points;
      std::uniform_int_distribution<int> column(0, columns - 1);
      g.field_columns.clear();
      g.field_weights.clear();
      for (std::size_t q = 0; q < points; ++q)
        for (const double weight : {0.5, 0.3, 0.2}) {
          g.field_columns.push_back(column(rng));
          g.field_weights.push_back(weight);
        }
    }
    return c;
  };
  for (const PrismTables& tables : instruction_sets())
    for (const DamperScheme scheme : kSchemes)
      expect_same(with_field(tables.skin, scheme), with_field(dual, scheme), worst);
  std::printf("parameters by point: %.1e\n", worst);
}

/// History before and after a step, in packs and point by point, down to strains that are all but rounding.
TEST(PackedHistory, AgreesWithPointByPoint) {
  const KernelTable by_points = table_by_points<SkinLaw>();
  double worst = 0;
  for (const PrismTables& tables : instruction_sets())
    for (const DamperScheme scheme : kSchemes)
      for (const double amount : {1.0, 1e-4, 1e-8, 0.0}) {
        SCOPED_TRACE(testing::Message() << tables.isa << ", strains times " << amount);
        VectorXd before[2], after[2];
        for (const bool packed : {false, true}) {
          TermCase c = skin_case(packed ? tables.skin : by_points, true, scheme, 2, 2, 0.3);
          c.u_old *= amount;
          c.u *= amount;
          c.history *= amount;
          TermStepData data;
          c.term().prepare(c.step, c.native, c.u_old, c.history.data(), data);
          before[packed] = Eigen::Map<VectorXd>(data.prepared.data(), c.history.size());
          after[packed].resize(c.history.size());
          c.term().update(c.step, data, c.u, after[packed].data());
        }
        for (const VectorXd* h : {before, after}) {
          EXPECT_LE((h[1] - h[0]).norm(), 1e-14 * h[0].norm());
          if (amount > 0) worst = std::max(worst, (h[1] - h[0]).norm() / h[0].norm());
        }
        if (scheme == DamperScheme::exponential && amount > 0) {
          EXPECT_GT((after[1] - before[1]).norm(), 1e-3 * before[1].norm());
        }
      }
  std::printf("histories differ by %.1e at most\n", worst);
}

}  // namespace
}  // namespace rhytid::test
