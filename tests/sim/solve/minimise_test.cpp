#include "sim/solve/minimise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

#include "sim/core/error.h"
#include "tests/sim/solve/minimise_case.h"

namespace rhytid {
namespace {

TEST(Minimise, ConvexQuadraticTakesOneNewtonStep) {
  QuadraticChain objective(30);
  const auto [report, q, factor, matrix] = solve(objective, random_vector(90, -1, 1), {});
  EXPECT_TRUE(report.converged()) << name(report.status);
  EXPECT_EQ(report.iterations, 1);
  EXPECT_EQ(report.evaluations, 2);
  EXPECT_EQ(report.factorisations, 2);  // one for the step, one as the certificate
  EXPECT_EQ(report.residuals.size(), 2u);
  EXPECT_EQ(report.evaluations, objective.evaluations);
  EXPECT_EQ(report.factorisations, objective.raw_hessians);
  EXPECT_EQ(objective.projected_hessians, 0);
  EXPECT_GT(report.smallest_pivot, 0);
  EXPECT_GT(report.largest_pivot, report.smallest_pivot);
  EXPECT_LE((q - objective.solution()).norm(), 1e-9 * q.norm());
}

TEST(Minimise, AllMinimisersFindTheEndOfTheValley) {
  for (const Minimiser method : kAll) {
    RosenbrockChain objective(12);
    MinimiserOptions options;
    options.method = method;
    options.max_iterations = 3000;
    const auto [report, q, factor, matrix] = solve(objective, random_vector(36, 0, 0.9), options);
    EXPECT_TRUE(report.converged()) << name(method) << ": " << name(report.status) << " after "
                                    << report.iterations << ", residual " << report.residual;
    EXPECT_LE((q - VectorXd::Ones(36)).cwiseAbs().maxCoeff(), 1e-8) << name(method);
    EXPECT_LE(report.residual, report.tolerance);
    EXPECT_LT(report.energy, 1e-15);
    EXPECT_EQ(report.evaluations, objective.evaluations);
    EXPECT_EQ(report.residuals.size(), static_cast<std::size_t>(report.iterations) + 1);
    if (method == Minimiser::lbfgs) {
      EXPECT_GT(report.lbfgs_iterations, 10);
      EXPECT_LT(report.factorisations, report.iterations / 5) << "a factor must serve many steps";
    } else if (method == Minimiser::newton) {
      EXPECT_GT(report.lbfgs_iterations, 0) << "the end of the valley converges fast";
      EXPECT_LT(report.lbfgs_iterations, report.iterations / 2);
    } else {
      EXPECT_EQ(report.lbfgs_iterations, 0);
    }
  }
}

TEST(Minimise, AFactorIsKeptWhileThatConvergesFast) {
  // A chain that is nearly quadratic: after its first step Newton would need a factor for each of the next.
  RosenbrockChain kept_objective(12), fresh_objective(12);
  const VectorXd start = VectorXd::Ones(36) + random_vector(36, 0, 0.02);
  MinimiserOptions options;
  const auto [kept, q, factor, matrix] = solve(kept_objective, start, options);
  options.keep_factor = false;
  const auto [fresh, p, fresh_factor, fresh_matrix] = solve(fresh_objective, start, options);
  ASSERT_TRUE(kept.converged() && fresh.converged());
  EXPECT_EQ(fresh.lbfgs_iterations, 0);
  EXPECT_EQ(fresh.factorisations, fresh.iterations) << "the last step's is the certificate";
  EXPECT_GT(kept.lbfgs_iterations, 1);
  EXPECT_EQ(kept.factorisations, kept.iterations - kept.lbfgs_iterations + 1)
      << "and one for the certificate";
  EXPECT_LT(kept.factorisations, fresh.factorisations);
  EXPECT_EQ(kept.evaluations, kept_objective.evaluations);
  EXPECT_LE((p - q).cwiseAbs().maxCoeff(), 1e-8);
  // Each step with it but the last of a row left at most kKeepWhile of the residual.
  int slow = 0;
  for (std::size_t k = 1; k < kept.residuals.size(); ++k)
    slow += kept.residuals[k] > kKeepWhile * kept.residuals[k - 1] ? 1 : 0;
  EXPECT_LE(slow, kept.iterations - kept.lbfgs_iterations + 1);
}

TEST(Minimise, LiteralLbfgsGoesToItsEndAlone) {
  RosenbrockChain objective(12);
  MinimiserOptions options = published_minimiser();
  EXPECT_EQ(options.lbfgs_refresh, 50);
  options.max_iterations = 3000;
  options.certify_minimum = options.polish = true;  // there is nothing that could
  const auto [report, q, factor, matrix] = solve(objective, random_vector(36, 0, 0.9), options);
  EXPECT_TRUE(report.converged()) << name(report.status);
  EXPECT_EQ(report.tolerance, 1e-6);
  EXPECT_LE(report.residual, 1e-6);
  EXPECT_EQ(report.iterations, report.lbfgs_iterations);
  EXPECT_EQ(objective.raw_hessians, 0);
  EXPECT_GT(report.iterations, 50);
  EXPECT_EQ(report.factorisations, (report.iterations + 49) / 50) << "no step was below 1e-6 here";

  DoubleWellChain saddle(20);
  EXPECT_TRUE(solve(saddle, VectorXd::Zero(60), options).report.converged()) << "its gradient test holds";
  EXPECT_EQ(saddle.projected_hessians, 0);

  // Where nothing more is to be had it says so, and does not call Newton either.
  QuadraticChain rounding(30);
  rounding.offset = 1e6;
  options.absolute_tolerance = 1e-300;
  const MinimiserReport stopped = solve(rounding, random_vector(90, -1, 1), options).report;
  EXPECT_EQ(stopped.status, MinimiserStatus::stagnated) << name(stopped.status);
  EXPECT_EQ(rounding.raw_hessians, 0);
}

TEST(Minimise, RawHessianConvergesQuadratically) {
  RosenbrockChain objective(12);
  MinimiserOptions options;
  options.absolute_tolerance = 1e-9;
  options.keep_factor = false;
  const MinimiserReport report = solve(objective, random_vector(36, 0.8, 1.2), options).report;
  ASSERT_TRUE(report.converged());
  const auto& r = report.residuals;
  ASSERT_GE(r.size(), 4u);
  EXPECT_LT(r.end()[-1], 1e-3 * r.end()[-2]);
}

TEST(Minimise, SinglePrecisionSteersToTheSameMinimum) {
  for (const Minimiser method : kAll) {
    RosenbrockChain objective(12);
    MinimiserOptions options;
    options.method = method;
    options.max_iterations = 3000;
    const VectorXd start = random_vector(36, 0, 0.9);
    const auto [full, expected, full_factor, full_matrix] = solve(objective, start, options);
    EXPECT_EQ(full.single_factorisations, 0) << "a small factor is worth no risk";
    options.precision = FactorPrecision::mixed;
    const auto [mixed, q, factor, matrix] = solve(objective, start, options);
    ASSERT_TRUE(mixed.converged()) << name(method) << ": " << name(mixed.status);
    EXPECT_EQ(2 * (mixed.factorisations - mixed.single_factorisations), mixed.failed_factorisations)
        << "double precision only confirms what single precision refuses";
    EXPECT_EQ(factor.precision(), Precision::single);
    EXPECT_EQ(mixed.smallest_pivot, factor.smallest_pivot());
    EXPECT_LE((q - expected).norm(), 1e-7 * expected.norm()) << name(method);
    EXPECT_LE(mixed.iterations, full.iterations + full.iterations / 4 + 2) << name(method);
    options.polish = true;
    const auto [polished, p, last_factor, last_matrix] = solve(objective, start, options);
    ASSERT_TRUE(polished.converged()) << name(method) << ": " << name(polished.status);
    EXPECT_GT(polished.single_factorisations, polished.factorisations / 2) << name(method);
    EXPECT_LT(polished.single_factorisations, polished.factorisations) << "a polish has double precision";
    EXPECT_EQ(last_factor.precision(), Precision::full);
    EXPECT_LE(polished.residual, mixed.residual);
  }
}

/// Springs between neighbours and next to nothing to the ground: smooth displacements are softer by `softness`.
class IllConditionedChain final : public QuadraticChain {
 public:
  IllConditionedChain(int n, double softness) : QuadraticChain(n) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      a[i].setZero();
      b[i].setZero();
      for (int k = 0; k < 3; ++k) {
        a[i](k, k) = a[i](k + 3, k + 3) = 1 + softness;
        a[i](k, k + 3) = a[i](k + 3, k) = -1;
      }
    }
  }
};

TEST(Minimise, DoublePrecisionTakesOverWhereSingleFails) {
  // Beyond single precision; around its end, where it factors but needs many corrections; well within.
  for (const double softness : {1e-9, 1e-7, 3e-7, 1e-6, 1e-5, 1e-3}) {
    SCOPED_TRACE(softness);
    IllConditionedChain objective(200, softness);
    MinimiserOptions options;
    options.absolute_tolerance = 1e-8;
    options.relative_tolerance = 0;
    options.precision = FactorPrecision::mixed;
    const auto [report, q, factor, matrix] = solve(objective, random_vector(600, -1, 1), options);
    EXPECT_TRUE(report.converged()) << name(report.status);
    EXPECT_LE(report.iterations, 4);
    if (softness == 1e-9) {
      EXPECT_EQ(report.single_factorisations, 1) << "what has failed once is not tried again";
    } else {
      EXPECT_GE(report.single_factorisations, 1);
    }
    EXPECT_EQ(report.smallest_pivot, factor.smallest_pivot());
  }
}

/// So many modes that single precision gets wrong that twelve corrections are not enough (with OpenBLAS's kernels for
/// AVX2: the second step's factor is then made in double); with any kernels the minimum is found.
TEST(Minimise, DoublePrecisionTakesOverWhereCorrectionsRunOut) {
  const int n = 30000;
  IllConditionedChain objective(n, 0);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1.2e-7);
  for (Matrix6& piece : objective.a) piece.diagonal().head<3>().setConstant(1 + uniform(random));
  MinimiserOptions options;
  options.absolute_tolerance = 1e-8;
  options.relative_tolerance = 0;
  options.precision = FactorPrecision::mixed;
  const auto [report, q, factor, matrix] = solve(objective, random_vector(3 * n, -1, 1), options);
  EXPECT_TRUE(report.converged()) << name(report.status);
  EXPECT_LE(report.iterations, 4);
  // Other kernels round otherwise and may get by.
  const int doubles = report.factorisations - report.single_factorisations;
  if (doubles < 1) std::printf("corrections sufficed with these kernels: %d factors in double\n", doubles);
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && !__builtin_cpu_supports("avx512f")) {
    EXPECT_GE(doubles, 1);
  }
#endif
  VectorXd gradient(3 * n);
  (void)objective.energy(q, &gradient);
  EXPECT_LE(gradient.norm(), 1e-8);
}

/// What a certificate in single precision does not overlook.
TEST(Minimise, SinglePrecisionRefusesNegativeCurvatureOfAMillionthOfTheStiffness) {
  for (const double curvature : {-1e-3, -1e-4, -1e-5, -1e-6}) {
    IllConditionedChain objective(200, curvature);
    BlockMatrix matrix(objective.pattern());
    objective.hessian(VectorXd::Zero(600), Curvature::raw, matrix);
    CholeskyFactor factor(objective.pattern());
    EXPECT_FALSE(factor.factorize(matrix, 0, Precision::single)) << curvature;
    EXPECT_FALSE(factor.factorize(matrix, 0, Precision::full)) << curvature;
  }
}

TEST(Minimise, LiteralLbfgsKeepsDoublePrecision) {
  RosenbrockChain objective(12);
  MinimiserOptions options = published_minimiser();
  options.precision = FactorPrecision::mixed;
  options.max_iterations = 3000;
  EXPECT_EQ(solve(objective, random_vector(36, 0.8, 1.2), options).report.single_factorisations, 0);
}

TEST(Minimise, LengthensStepsOfAProjectedHessianThatIsFarTooStiff) {
  JustBuckledChain objective(12);
  objective.fixed = {33, 34, 35};
  VectorXd start = VectorXd::Zero(36);
  for (int i = 1; i < 11; ++i) start[3 * i] = 1e-4 * (i % 2 ? 1 : -1);
  const auto [report, q, factor, matrix] = solve(objective, start, {});
  EXPECT_TRUE(report.converged()) << name(report.status);
  EXPECT_LT(report.iterations, 30) << "a hundred of its own steps make one that matters";
  EXPECT_EQ(report.evaluations, objective.evaluations);
  for (int i = 1; i < 11; ++i) EXPECT_NEAR(std::abs(q[3 * i]), 0.1, 1e-8);
}

TEST(Minimise, WithoutCertificateASaddlePasses) {
  DoubleWellChain objective(5);
  MinimiserOptions options;
  options.certify_minimum = false;
  const MinimiserReport report = solve(objective, VectorXd::Zero(15), options).report;
  EXPECT_TRUE(report.converged());
  EXPECT_EQ(report.factorisations, 0);
  options.polish = true;  // cannot: indefinite
  EXPECT_EQ(solve(objective, VectorXd::Zero(15), options).report.iterations, 0);
}

TEST(Minimise, RefusesToCertifyAFlatMinimum) {
  QuarticChain objective(4);
  const MinimiserReport report = solve(objective, VectorXd::Zero(12), {}).report;
  EXPECT_EQ(report.status, MinimiserStatus::not_a_minimum);
  EXPECT_EQ(report.iterations, 0);
  EXPECT_EQ(report.smallest_pivot, 0);
}

TEST(Minimise, StaysInsideTheDomain) {
  for (const Minimiser method : kAll) {
    for (const bool knows : {true, false}) {
      BarrierChain objective(15);
      objective.knows_its_domain = knows;
      MinimiserOptions options;
      options.method = method;
      options.max_iterations = 1000;
      const auto [report, q, factor, matrix] = solve(objective, random_vector(45, 3, 9), options);
      EXPECT_TRUE(report.converged()) << name(method) << ": " << name(report.status);
      EXPECT_LE((q - VectorXd::Ones(45)).cwiseAbs().maxCoeff(), 1e-8);
      if (knows) {
        EXPECT_GT(objective.lowest_seen, 0) << "evaluated beyond the largest feasible step";
      } else if (method == Minimiser::newton) {
        EXPECT_LE(objective.lowest_seen, 0) << "the test should have tried the other side";
      }
    }
  }
}

TEST(Minimise, CertificateLeavesTheFactorOfTheRawHessian) {
  for (const Minimiser method : kAll) {
    DoubleWellChain objective(8);
    MinimiserOptions options;
    options.method = method;
    const auto [report, q, factor, matrix] = solve(objective, random_vector(24, 0.2, 1), options);
    ASSERT_TRUE(report.converged()) << name(method) << ": " << name(report.status);
    BlockMatrix raw(objective.pattern());
    objective.hessian(q, Curvature::raw, raw);
    const VectorXd x = random_vector(24, -1, 1);
    EXPECT_LE((VectorXd(factor.solve(raw.multiply(x))) - x).norm(), 1e-10);
    EXPECT_EQ(matrix.multiply(x), raw.multiply(x));
  }
}

TEST(Minimise, PolishLowersTheResidual) {
  RosenbrockChain objective(6);
  objective.scale = 1;
  MinimiserOptions options;
  options.relative_tolerance = 1e-3;
  const VectorXd start = random_vector(18, 0.7, 1.1);
  const MinimiserReport plain = solve(objective, start, options).report;
  options.polish = true;
  const MinimiserReport polished = solve(objective, start, options).report;
  ASSERT_TRUE(plain.converged() && polished.converged());
  EXPECT_EQ(polished.iterations, plain.iterations + 1);
  EXPECT_EQ(polished.factorisations, plain.factorisations);
  EXPECT_LT(polished.residual, 1e-2 * plain.residual);
}

TEST(Minimise, ToleranceFollowsTheForceScale) {
  QuadraticChain objective(5);
  objective.scale = 1e12;
  MinimiserOptions options;
  const MinimiserReport report = solve(objective, random_vector(15, -1, 1), options).report;
  EXPECT_EQ(report.iterations, 0);
  EXPECT_DOUBLE_EQ(report.tolerance, 1e12 * options.relative_tolerance + options.absolute_tolerance);
}

TEST(Minimise, SaysWhyItStopped) {
  RosenbrockChain valley(12);
  const VectorXd start = random_vector(36, 0, 0.9);
  MinimiserOptions options;
  options.max_iterations = 3;
  for (const Minimiser method : kAll) {
    options.method = method;
    const Outcome short_run = solve(valley, start, options);
    EXPECT_EQ(short_run.report.status, MinimiserStatus::max_iterations);
    EXPECT_EQ(short_run.report.iterations, 3);
    EXPECT_NE(short_run.q, start) << "the last point must be handed back";

    std::vector<int> seen;
    const Outcome stopped = solve(valley, start, options, [&](int iteration, double energy, double residual) {
      seen.push_back(iteration);
      EXPECT_TRUE(std::isfinite(energy) && residual > 0);
      return iteration < 2;
    });
    EXPECT_EQ(stopped.report.status, MinimiserStatus::interrupted);
    EXPECT_EQ(seen, (std::vector<int>{0, 1, 2}));
    EXPECT_EQ(stopped.report.iterations, 2);
    EXPECT_NE(stopped.q, start);
  }
  BarrierChain barrier(3);
  EXPECT_EQ(solve(barrier, -VectorXd::Ones(9), {}).report.status, MinimiserStatus::not_finite);
  EXPECT_EQ(solve(barrier, VectorXd::Constant(9, std::nan("")), {}).report.status,
            MinimiserStatus::not_finite);
}

TEST(Minimise, ConvergesBelowTheEnergysResolution) {
  for (const Minimiser method : kAll) {
    RosenbrockChain objective(12);
    objective.offset = 1e5;  // energy changes of the last steps drown in rounding, 1e-11 here
    MinimiserOptions options;
    options.method = method;
    options.max_iterations = 3000;
    options.relative_tolerance = 0;
    options.absolute_tolerance = 1e-10;
    const auto [report, q, factor, matrix] = solve(objective, random_vector(36, 0, 0.9), options);
    EXPECT_TRUE(report.converged()) << name(method) << ": " << name(report.status) << ", residual "
                                    << report.residual;
    EXPECT_LE((q - VectorXd::Ones(36)).cwiseAbs().maxCoeff(), 1e-8) << name(method);
  }
}

TEST(Minimise, StopsAtTheRoundingFloor) {
  for (const Minimiser method : kAll) {
    QuadraticChain objective(30);
    objective.offset = 1e6;  // hides energy changes below 1e-5 or so
    MinimiserOptions options;
    options.method = method;
    options.relative_tolerance = 0;
    options.absolute_tolerance = 1e-300;
    const MinimiserReport report = solve(objective, random_vector(90, -1, 1), options).report;
    EXPECT_EQ(report.status, MinimiserStatus::stagnated) << name(method) << ": " << name(report.status);
    EXPECT_LT(report.iterations, 60) << name(method);
    EXPECT_LT(report.residual, 1e-10) << name(method);
  }
}

TEST(Minimise, RepeatsToTheBit) {
  for (const Minimiser method : kAll) {
    DoubleWellChain objective(20);
    MinimiserOptions options;
    options.method = method;
    CholeskyFactor factor(objective.pattern());
    BlockMatrix matrix(objective.pattern());
    VectorXd first = VectorXd::Zero(60), second = first;
    ASSERT_TRUE(minimise(objective, first, options, factor, matrix).converged());
    ASSERT_TRUE(minimise(objective, second, options, factor, matrix).converged());
    EXPECT_EQ(first, second);
  }
}

TEST(Minimise, RefusesBrokenOptions) {
  QuadraticChain objective(3);
  const auto broken = [&](auto change) {
    MinimiserOptions options;
    change(options);
    EXPECT_THROW((void)solve(objective, VectorXd::Zero(9), options), ContractError);
  };
  broken([](MinimiserOptions& o) { o.relative_tolerance = -1; });
  broken([](MinimiserOptions& o) { o.absolute_tolerance = std::nan(""); });
  broken([](MinimiserOptions& o) { o.max_iterations = -1; });
  broken([](MinimiserOptions& o) { o.lbfgs_memory = 0; });
  broken([](MinimiserOptions& o) { o.lbfgs_refresh = 0; });
  EXPECT_THROW((void)solve(objective, VectorXd::Zero(6), {}), ContractError);
}

}  // namespace
}  // namespace rhytid
