// Block assembly and factorisation against dense Eigen on random meshes of overlapping cliques.
#include "sim/solve/block_matrix.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <random>

#include "sim/core/error.h"

namespace rhytid {
namespace {

struct RandomProblem {
  int num_blocks;
  std::vector<std::vector<int>> cliques;
  std::vector<MatrixXd> dense;  ///< one symmetric positive definite matrix per clique
  MatrixXd full;                ///< their sum, with −1 blocks dropped

  /// A ring of num_blocks nodes; clique c couples `size` distinct nodes near c, a few of them not unknowns
  /// (−1).
  RandomProblem(int n, int size, unsigned seed, bool with_dropped)
      : num_blocks(n), full(MatrixXd::Zero(3 * n, 3 * n)) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (int c = 0; c < n; ++c) {
      std::vector<int> near(2 * size);
      for (int k = 0; k < 2 * size; ++k) near[k] = (c + k * k) % n;
      std::sort(near.begin(), near.end());
      near.erase(std::unique(near.begin(), near.end()), near.end());
      std::shuffle(near.begin(), near.end(), random);
      near.resize(std::min<std::size_t>(near.size(), size));
      if (with_dropped && c % 3 == 0) near[c % near.size()] = -1;
      const int m = 3 * static_cast<int>(near.size());
      MatrixXd b = MatrixXd::NullaryExpr(m, m, [&] { return normal(random); });
      dense.push_back(b * b.transpose() + 0.1 * MatrixXd::Identity(m, m));
      for (int i = 0; i < m; ++i)
        for (int j = 0; j < m; ++j)
          if (near[i / 3] >= 0 && near[j / 3] >= 0)
            full(3 * near[i / 3] + i % 3, 3 * near[j / 3] + j % 3) += dense.back()(i, j);
      cliques.push_back(near);
    }
  }

  void assemble(BlockMatrix& matrix) const {
    matrix.set_zero();
    for (std::size_t c = 0; c < cliques.size(); ++c) {
      // Only the lower triangle may be read: the upper one of the row-major array is poisoned.
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> lower = dense[c];
      lower.triangularView<Eigen::StrictlyUpper>().setConstant(std::numeric_limits<double>::quiet_NaN());
      matrix.add(static_cast<int>(c), lower.data());
    }
  }
};

MatrixXd random_matrix(int rows, int columns, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  return MatrixXd::NullaryExpr(rows, columns, [&] { return uniform(random); });
}

/// The whole matrix, read back through multiply.
MatrixXd to_dense(const BlockMatrix& matrix) {
  const int n = matrix.pattern().num_unknowns();
  MatrixXd result(n, n);
  for (int j = 0; j < n; ++j) result.col(j) = matrix.multiply(VectorXd::Unit(n, j));
  return result;
}

class BlockMatrixTest : public ::testing::TestWithParam<std::tuple<int, int, bool>> {};

TEST_P(BlockMatrixTest, AssemblesFactorisesAndSolvesLikeDense) {
  const auto [n, size, with_dropped] = GetParam();
  const RandomProblem problem(n, size, 7 * n + size, with_dropped);
  const BlockPattern pattern(n, problem.cliques);
  BlockMatrix matrix(pattern);
  for (int repeat = 0; repeat < 2; ++repeat) problem.assemble(matrix);  // set_zero really clears
  const double scale = problem.full.cwiseAbs().maxCoeff();
  EXPECT_LE((to_dense(matrix) - problem.full).cwiseAbs().maxCoeff(), 1e-13 * scale);
  EXPECT_DOUBLE_EQ(matrix.diagonal_max(), problem.full.diagonal().maxCoeff());

  CholeskyFactor factor(pattern);
  EXPECT_FALSE(factor.usable());
  ASSERT_TRUE(factor.factorize(matrix));
  EXPECT_TRUE(factor.usable());
  const MatrixXd rhs = random_matrix(3 * n, 5, 3);
  const MatrixXd expected = problem.full.ldlt().solve(rhs);
  EXPECT_LE((factor.solve(rhs) - expected).norm(), 1e-10 * expected.norm());
  EXPECT_LE((factor.solve(matrix, rhs) - expected).norm(), 1e-10 * expected.norm());
  const VectorXd single = factor.solve(rhs.col(3));
  EXPECT_LE((single - expected.col(3)).norm(), 1e-10 * expected.norm());

  // Every pivot lies between the extreme eigenvalues, and their extremes are pivots of some ordering.
  const VectorXd eigenvalues = problem.full.selfadjointView<Eigen::Lower>().eigenvalues();
  EXPECT_GE(factor.smallest_pivot(), eigenvalues.minCoeff() * (1 - 1e-10));
  EXPECT_LE(factor.largest_pivot(), eigenvalues.maxCoeff() * (1 + 1e-10));
  EXPECT_LT(factor.smallest_pivot(), factor.largest_pivot());
  EXPECT_GE(factor.factor_entries(), pattern.num_entries());

  const double shift = 0.37 * scale;
  ASSERT_TRUE(factor.factorize(matrix, shift));
  const MatrixXd shifted = problem.full + shift * MatrixXd::Identity(3 * n, 3 * n);
  EXPECT_LE((shifted * factor.solve(rhs) - rhs).norm(), 1e-12 * rhs.norm());
}

TEST_P(BlockMatrixTest, SinglePrecisionIsAPreconditioner) {
  const auto [n, size, with_dropped] = GetParam();
  const RandomProblem problem(n, size, 13 * n + size, with_dropped);
  const BlockPattern pattern(n, problem.cliques);
  BlockMatrix matrix(pattern);
  problem.assemble(matrix);
  CholeskyFactor factor(pattern), full(pattern);
  ASSERT_TRUE(factor.factorize(matrix, 0, Precision::single));
  EXPECT_EQ(factor.precision(), Precision::single);
  ASSERT_TRUE(full.factorize(matrix));
  EXPECT_EQ(full.precision(), Precision::full);
  EXPECT_NEAR(factor.smallest_pivot(), full.smallest_pivot(), 1e-3 * full.smallest_pivot());
  EXPECT_NE(factor.smallest_pivot(), full.smallest_pivot());

  // Far from 1, where a float would overflow.
  const MatrixXd rhs = 1e60 * random_matrix(3 * n, 2, 3);
  const VectorXd eigenvalues = problem.full.selfadjointView<Eigen::Lower>().eigenvalues();
  const double condition = eigenvalues.maxCoeff() / eigenvalues.minCoeff();
  const MatrixXd expected = problem.full.ldlt().solve(rhs), alone = factor.solve(rhs);
  EXPECT_LE((alone - expected).norm(), 1e-6 * condition * expected.norm());
  EXPECT_GT((alone - expected).norm(), 1e-10 * expected.norm()) << "not in single precision";
  EXPECT_EQ(factor.solve(MatrixXd::Zero(3 * n, 1)).norm(), 0);
  const auto corrected = factor.solve_iteratively(matrix, rhs.col(1), 1e-12, 20);
  ASSERT_TRUE(corrected.has_value());
  EXPECT_LE((problem.full * *corrected - rhs.col(1)).norm(), 2e-12 * rhs.col(1).norm());
  EXPECT_FALSE(factor.solve_iteratively(matrix, rhs.col(1), 1e-12, 1).has_value()) << "one solve cannot do";

  // The same storage serves both precisions in turn.
  ASSERT_TRUE(factor.factorize(matrix));
  EXPECT_EQ(factor.solve(rhs), full.solve(rhs));
  EXPECT_FALSE(factor.factorize(matrix, -1.01 * eigenvalues.maxCoeff(), Precision::single));
  EXPECT_FALSE(factor.usable());
}

TEST_P(BlockMatrixTest, FixMakesIdentityRows) {
  const auto [n, size, with_dropped] = GetParam();
  const RandomProblem problem(n, size, 11 * n + size, with_dropped);
  const BlockPattern pattern(n, problem.cliques);
  BlockMatrix matrix(pattern);
  problem.assemble(matrix);
  MatrixXd expected = problem.full;
  for (const int unknown : {0, 4, 3 * n - 1, 3 * (n / 2), 3 * (n / 2) + 1, 3 * (n / 2) + 2}) {
    if (unknown >= 3 * n) continue;
    matrix.fix(unknown);
    expected.row(unknown).setZero();
    expected.col(unknown).setZero();
    expected(unknown, unknown) = 1;
  }
  EXPECT_LE((to_dense(matrix) - expected).cwiseAbs().maxCoeff(), 1e-13 * expected.cwiseAbs().maxCoeff());
  EXPECT_TRUE(CholeskyFactor(pattern).factorize(matrix));
  EXPECT_THROW(matrix.fix(3 * n), ContractError);
}

INSTANTIATE_TEST_SUITE_P(Sizes, BlockMatrixTest,
                         ::testing::Values(std::tuple{1, 1, false}, std::tuple{3, 2, false},
                                           std::tuple{20, 4, true}, std::tuple{60, 9, true},
                                           std::tuple{120, 12, false}));

TEST(CholeskyFactor, PivotsOfADiagonalMatrixAreItsEntries) {
  const BlockPattern pattern(4, {});  // blocks of no clique still have their diagonal
  BlockMatrix matrix(pattern);
  EXPECT_EQ(pattern.num_entries(), 4u * 6u);
  for (int i = 0; i < 12; ++i) matrix.fix(i);
  CholeskyFactor factor(pattern);
  ASSERT_TRUE(factor.factorize(matrix, 3.0));
  EXPECT_DOUBLE_EQ(factor.smallest_pivot(), 4.0);
  EXPECT_DOUBLE_EQ(factor.largest_pivot(), 4.0);
}

TEST(CholeskyFactor, SaysNoToIndefiniteSingularAndNonFinite) {
  const RandomProblem problem(40, 6, 5, false);
  const BlockPattern pattern(40, problem.cliques);
  BlockMatrix matrix(pattern);
  problem.assemble(matrix);
  CholeskyFactor factor(pattern);
  const VectorXd rhs = VectorXd::Ones(120);
  ASSERT_TRUE(factor.factorize(matrix));
  const VectorXd expected = factor.solve(rhs);

  const double smallest = problem.full.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff();
  EXPECT_FALSE(factor.factorize(matrix, -1.001 * smallest));
  EXPECT_FALSE(factor.usable());
  EXPECT_EQ(factor.smallest_pivot(), 0);
  EXPECT_THROW((void)factor.solve(rhs), ContractError);
  EXPECT_TRUE(factor.factorize(matrix, -0.999 * smallest));
  EXPECT_FALSE(factor.factorize(BlockMatrix(pattern)));  // all zero

  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const std::size_t where : {std::size_t{0}, pattern.num_entries() / 2, pattern.num_entries() - 1}) {
      BlockMatrix broken = matrix;
      broken.values()[where] = bad;
      EXPECT_FALSE(factor.factorize(broken)) << bad << " at " << where;
    }
  }
  ASSERT_TRUE(factor.factorize(matrix));  // and recovers, to the same bits
  EXPECT_EQ(factor.solve(rhs), expected);
}

TEST(CholeskyFactor, MovesAndKeepsItsFactor) {
  const RandomProblem problem(10, 3, 1, false);
  const BlockPattern pattern(10, problem.cliques);
  BlockMatrix matrix(pattern);
  problem.assemble(matrix);
  CholeskyFactor first(pattern);
  ASSERT_TRUE(first.factorize(matrix));
  const VectorXd expected = first.solve(VectorXd::Ones(30));
  CholeskyFactor second = std::move(first);
  EXPECT_EQ(VectorXd(second.solve(VectorXd::Ones(30))), expected);
  const BlockPattern other(10, problem.cliques);
  EXPECT_THROW((void)second.factorize(BlockMatrix(other)), ContractError);
}

TEST(BlockPattern, RefusesBadCliques) {
  EXPECT_THROW(BlockPattern(0, {}), ContractError);
  EXPECT_THROW(BlockPattern(3, {{0, 3}}), ContractError);
  EXPECT_THROW(BlockPattern(3, {{0, -2}}), ContractError);
  EXPECT_THROW(BlockPattern(3, {{0, 1, 0}}), ContractError);
  EXPECT_NO_THROW(BlockPattern(3, {{0, -1, -1}, {}, {2, 1}}));
}

}  // namespace
}  // namespace rhytid
