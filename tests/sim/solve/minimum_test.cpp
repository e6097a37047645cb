// What a minimum is certified by, saddles that must be left, and factors of nearby problems.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/sim/solve/minimise_case.h"

namespace rhytid {
namespace {

TEST(Minimise, LeavesAnExactSaddle) {
  for (const Minimiser method : kAll)
    for (const FactorPrecision precision : {FactorPrecision::full, FactorPrecision::mixed}) {
      DoubleWellChain objective(20);
      objective.fixed = {3 * 7 + 1, 3 * 19 + 2};
      MinimiserOptions options;
      options.method = method;
      options.precision = precision;
      const auto [report, q, factor, matrix] = solve(objective, VectorXd::Zero(60), options);
      EXPECT_TRUE(report.converged()) << name(method) << ": " << name(report.status);
      EXPECT_GE(report.negative_curvature_exits, 1);
      EXPECT_LT(report.energy, 19 * 0.25 - 0.1);
      EXPECT_GT(report.smallest_pivot, 0);
      EXPECT_LT(report.residual, 1e-8);
      for (int i = 0; i < 20; ++i) EXPECT_GT(std::abs(q[3 * i]), 0.05) << "block " << i;
      for (const int k : objective.fixed) EXPECT_EQ(q[k], 0) << "a fixed unknown moved";
    }
}

/// W = ½ x² + ½ (x − ½) y² + ¼ y⁴, and springs for the rest: the straight path to the saddle at 0 passes its critical
/// load at x = ½, in one whole step of Newton's that leaves no residual. Minima at (−½, ±1), W = −⅛.
class LoadedColumn final : public ChainObjective {
 public:
  LoadedColumn() : ChainObjective(2) {}
  double piece(int, const Vector6& v, Vector6& gradient, Matrix6& hessian) const override {
    const double x = v[0], y = v[1];
    gradient = v;
    hessian = Matrix6::Identity();
    gradient[0] = x + 0.5 * y * y;
    gradient[1] = (x - 0.5) * y + y * y * y;
    hessian(0, 1) = hessian(1, 0) = y;
    hessian(1, 1) = x - 0.5 + 3 * y * y;
    return 0.5 * (x * x + v.tail<4>().squaredNorm()) + 0.5 * (x - 0.5) * y * y + 0.25 * y * y * y * y;
  }
};

TEST(Minimise, AStepPastACriticalLoadIsNoCertificate) {
  for (const FactorPrecision precision : {FactorPrecision::full, FactorPrecision::mixed}) {
    LoadedColumn objective;
    MinimiserOptions options;
    options.precision = precision;
    const auto [report, q, factor, matrix] = solve(objective, VectorXd::Unit(6, 0), options);
    EXPECT_TRUE(report.converged()) << name(report.status);
    EXPECT_GE(report.negative_curvature_exits, 1);
    EXPECT_NEAR(report.energy, -0.125, 1e-9);
  }
}

TEST(Minimise, BeginsWithTheFactorOfANearbyProblem) {
  RosenbrockChain objective(12);
  MinimiserOptions options;
  auto [report, q, factor, matrix] =
      solve(objective, VectorXd::Ones(36) + random_vector(36, 0, 0.02), options);
  ASSERT_TRUE(report.converged());
  const VectorXd start = q + random_vector(36, -1e-3, 1e-3);
  VectorXd fresh = start, warm = start;
  const MinimiserReport first = minimise(objective, warm, options, factor, matrix, {}, GivenFactor::near);
  const int served = first.lbfgs_iterations - (first.iterations - first.lbfgs_iterations);
  const MinimiserReport second = minimise(objective, fresh, options, factor, matrix);
  ASSERT_TRUE(first.converged() && second.converged());
  EXPECT_GT(served, 0);
  EXPECT_LT(first.factorisations, second.factorisations);
  EXPECT_LE((warm - fresh).cwiseAbs().maxCoeff(), 1e-8);
  EXPECT_GT(first.smallest_pivot, 0) << "certified at its own end";

  // One that is of no use costs a trial.
  BlockMatrix other_matrix(objective.pattern());
  for (double& v : other_matrix.values()) v = 0;
  for (int i = 0; i < 36; ++i) other_matrix.fix(i);
  ASSERT_TRUE(factor.factorize(other_matrix));
  VectorXd far = start;
  const MinimiserReport third = minimise(objective, far, options, factor, matrix, {}, GivenFactor::near);
  ASSERT_TRUE(third.converged());
  EXPECT_LE(third.factorisations, second.factorisations + 1);
  EXPECT_LE((far - fresh).cwiseAbs().maxCoeff(), 1e-8);

  // Only Newton's method that may keep factors takes it.
  options.keep_factor = false;
  VectorXd alone = start;
  EXPECT_EQ(minimise(objective, alone, options, factor, matrix, {}, GivenFactor::near).lbfgs_iterations, 0);
}

}  // namespace
}  // namespace rhytid
