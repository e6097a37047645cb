// Singular directions of Jacobians that are known, and what is said of them.
#include "adjoint/directions.h"

#include <gtest/gtest.h>

#include <random>

#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

MatrixXd random_matrix(int rows, int columns, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, columns, [&] { return normal(rng); });
}

TEST(Directions, OfADiagonalJacobianAreItsAxes) {
  MatrixXd J = MatrixXd::Zero(4, 3);
  J(0, 0) = 2, J(1, 1) = -5;  // the third parameter has no effect
  const Directions d = directions_of(J);
  EXPECT_EQ(d.rank, 2);
  EXPECT_NEAR((d.singular_values - Vec3(5, 2, 0)).norm(), 0, 1e-14);
  EXPECT_NEAR((d.right_vectors.col(0) - Vec3(0, 1, 0)).norm(), 0, 1e-14);
  EXPECT_NEAR((d.right_vectors.col(2) - Vec3(0, 0, 1)).norm(), 0, 1e-14);
  EXPECT_FALSE(d.is_open(Vec3(1, 3, 0)));
  EXPECT_TRUE(d.is_open(Vec3(1, 3, 1e-3)));
}

TEST(Directions, BasisMakesTheJacobianOrthonormal) {
  MatrixXd J = random_matrix(20, 5, 1);
  J.col(4) = J.col(0) - 2 * J.col(1);
  const Directions d = directions_of(J);
  ASSERT_EQ(d.rank, 4);
  const MatrixXd P = d.basis();
  EXPECT_NEAR((P.transpose() * J.transpose() * J * P - MatrixXd::Identity(4, 4)).norm(), 0, 1e-12);
  VectorXd null_vector(5);
  null_vector << 1, -2, 0, 0, -1;
  EXPECT_NEAR(std::abs(d.right_vectors.col(4).dot(null_vector)), null_vector.norm(), 1e-12);
}

TEST(Directions, ANullVectorThatIsKnownLeadsTheNullSpace) {
  MatrixXd J = random_matrix(20, 6, 2);
  J.col(3) = -J.col(0) - J.col(1);  // 1, 1, 0, 1, 0, 0
  J.col(5) = J.col(4);              // 0, 0, 0, 0, 1, -1
  J.col(2) = 2 * J.col(0);          // 2, 0, -1, 0, 0, 0
  VectorXd gauge(6);
  gauge << 1, 1, 0, 1, 0, 0;
  Directions d = directions_of(J);
  ASSERT_EQ(d.rank, 3);
  ASSERT_TRUE(lead_null_space(d, gauge));
  EXPECT_NEAR((d.right_vectors.col(3) - gauge / gauge.norm()).norm(), 0, 1e-10);
  EXPECT_NEAR((J * d.right_vectors.rightCols(3)).norm(), 0, 1e-10);
  EXPECT_NEAR((d.right_vectors.transpose() * d.right_vectors - MatrixXd::Identity(6, 6)).norm(), 0, 1e-10);
  EXPECT_FALSE(lead_null_space(d, VectorXd::Unit(6, 0)));
}

TEST(Directions, InWords) {
  EXPECT_EQ(named_components(Vec3(-0.4, 1, 0.2)), (std::vector<int>{1, 0}));
  const std::vector<std::string> names = {"a", "b", "c"};
  EXPECT_EQ(direction_in_words(Vec3(0.1, 1, 0), names), "b is not determined: changing it");
  EXPECT_EQ(direction_in_words(Vec3(1, 0.9, 0.8), names), "a, b, c go together: raising all of them");
  EXPECT_EQ(direction_in_words(Vec3(-0.5, 1, 0), names),
            "b trade off against a: raising the former while lowering the latter");
}

TEST(Directions, StackedRootHasTheSquareOfAllRows) {
  const MatrixXd A = random_matrix(2, 4, 3), B = random_matrix(9, 4, 4);
  const MatrixXd R = stacked_root(stacked_root(MatrixXd(), A), B);
  EXPECT_EQ(R.rows(), 4);
  EXPECT_NEAR((R.transpose() * R - A.transpose() * A - B.transpose() * B).norm(), 0, 1e-12);
  EXPECT_EQ(MatrixXd(R.triangularView<Eigen::StrictlyLower>()).norm(), 0);
}

TEST(Directions, RefuseAWideOrBrokenJacobian) {
  EXPECT_THROW(directions_of(MatrixXd::Ones(2, 3)), ContractError);
  EXPECT_THROW(directions_of(MatrixXd::Constant(3, 2, std::nan(""))), ContractError);
}

}  // namespace
}  // namespace rhytid::adjoint
