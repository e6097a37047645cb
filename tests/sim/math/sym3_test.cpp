// Matrix functions of symmetric 3×3 matrices, with and without duals, at distinct and repeated eigenvalues.
#include "sim/math/sym3.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "sim/core/types.h"
#include "sim/math/cubic.h"
#include "sim/math/jacobi.h"

namespace rhytid {
namespace {

using LongMat3 = Eigen::Matrix<long double, 3, 3>;

LongMat3 full(const double* y) {
  LongMat3 m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = y[kSym[i][j]];
  return m;
}

/// f of I + Y in long double through Eigen's iterative eigen-solver.
template <class F>
LongMat3 reference(const double* y, F f) {
  Eigen::SelfAdjointEigenSolver<LongMat3> s(full(y));
  Eigen::Matrix<long double, 3, 1> v;
  for (int i = 0; i < 3; ++i) v[i] = f(s.eigenvalues()[i]);
  return s.eigenvectors() * v.asDiagonal() * s.eigenvectors().transpose();
}

void random_y(std::mt19937& rng, double gap, double size, double* y) {
  std::normal_distribution<double> n;
  Mat3 a;
  for (int i = 0; i < 9; ++i) a(i / 3, i % 3) = n(rng);
  const Mat3 q = Eigen::HouseholderQR<Mat3>(a).householderQ();
  const Mat3 m = q * Vec3(size, size + gap, 0.3 * size).asDiagonal() * q.transpose();
  for (int c = 0; c < 6; ++c) y[c] = m(kSymRow[c], kSymCol[c]);
}

TEST(Sym3, LogAndPowerValues) {
  std::mt19937 rng(1);
  for (double size : {0.8, 1e-3, 1e-9})
    for (double gap : {0.3, 1e-7, 0.0}) {
      double y[6], out[6];
      random_y(rng, gap * size, size, y);
      log_one_plus(y, out);
      LongMat3 ref = reference(y, [](long double e) { return std::log1p(e); });
      for (int c = 0; c < 6; ++c) EXPECT_NEAR(out[c], double(ref(kSymRow[c], kSymCol[c])), 3e-15 * size);
      power_one_plus(y, 0.37, out);
      ref = reference(y, [](long double e) { return std::expm1(0.37L * std::log1p(e)); });
      for (int c = 0; c < 6; ++c) EXPECT_NEAR(out[c], double(ref(kSymRow[c], kSymCol[c])), 3e-15 * size);
    }
}

/// Derivatives against central differences in long double, extrapolated; also at exactly repeated
/// eigenvalues.
TEST(Sym3, DualDerivatives) {
  std::mt19937 rng(2);
  for (double gap : {0.3, 1e-5, 1e-13, 0.0}) {
    double y[6], dy[6];
    random_y(rng, gap, 0.5, y);
    random_y(rng, 0.4, 0.7, dy);
    Dual<1> yd[6], log_d[6], pow_d[6];
    for (int c = 0; c < 6; ++c) {
      yd[c] = y[c];
      yd[c].d[0] = dy[c];
    }
    Dual<1> t(0.37);
    t.d[0] = 0.9;
    log_one_plus(yd, log_d);
    power_one_plus(yd, t, pow_d);
    const auto difference = [&](long double h, bool power) {
      const auto at = [&](long double s) {
        Eigen::SelfAdjointEigenSolver<LongMat3> e(full(y) + s * full(dy));
        Eigen::Matrix<long double, 3, 1> v;
        for (int i = 0; i < 3; ++i) {
          const long double l = std::log1p(e.eigenvalues()[i]);
          v[i] = power ? std::expm1((0.37L + 0.9L * s) * l) : l;
        }
        return LongMat3(e.eigenvectors() * v.asDiagonal() * e.eigenvectors().transpose());
      };
      return LongMat3((at(h) - at(-h)) / (2 * h));
    };
    for (bool power : {false, true}) {
      const LongMat3 ref = (4 * difference(5e-5L, power) - difference(1e-4L, power)) / 3;
      const Dual<1>* d = power ? pow_d : log_d;
      for (int c = 0; c < 6; ++c)
        EXPECT_NEAR(d[c].d[0], double(ref(kSymRow[c], kSymCol[c])), 2e-13)
            << "gap " << gap << " power " << power;
    }
  }
}

TEST(Sym3, GeometricMeanOfCommutingAndGeneralMatrices) {
  std::mt19937 rng(5);
  double a[6], b[6], mean[6], back[6];
  random_y(rng, 0.3, 0.4, a);
  random_y(rng, 0.2, -0.3, b);
  geometric_mean(a, b, 0.3, mean);
  geometric_mean(b, a, 0.7, back);  // A #_t B = B #_(1−t) A
  for (int c = 0; c < 6; ++c) EXPECT_NEAR(mean[c], back[c], 2e-15);
  // det(A #_t B) = det A^(1−t) det B^t
  const double log_det = 0.7 * std::log1p(det_minus_one(a)) + 0.3 * std::log1p(det_minus_one(b));
  EXPECT_NEAR(std::log1p(det_minus_one(mean)), log_det, 1e-15);
}

TEST(Jacobi, ProjectionIsNearestPositiveSemidefinite) {
  std::mt19937 rng(9);
  std::normal_distribution<double> n;
  for (int draw = 0; draw < 20; ++draw) {
    double a[9][9];
    Eigen::Matrix<double, 9, 9> m;
    for (int i = 0; i < 9; ++i)
      for (int j = 0; j <= i; ++j) a[i][j] = a[j][i] = m(i, j) = m(j, i) = n(rng);
    project_psd<9>(a);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> s(m);
    const Eigen::Matrix<double, 9, 9> ref =
        s.eigenvectors() * s.eigenvalues().cwiseMax(0).asDiagonal() * s.eigenvectors().transpose();
    for (int i = 0; i < 9; ++i)
      for (int j = 0; j < 9; ++j) EXPECT_NEAR(a[i][j], ref(i, j), 1e-13);
  }
}

TEST(Jacobi, PacksAreProjectedLaneByLane) {
  std::mt19937 rng(10);
  std::normal_distribution<double> n;
  for (int draw = 0; draw < 20; ++draw) {
    Lanes pack[9][9];
    double one[kLanes][9][9];
    for (int lane = 0; lane < kLanes; ++lane) {
      // By turns indefinite, positive definite, of rank 4, diagonal, zero.
      double factor[9][9];
      for (auto& row : factor)
        for (double& entry : row) entry = n(rng);
      const int kind = (draw + lane) % 5, rank = kind == 2 ? 4 : 9;
      for (int i = 0; i < 9; ++i)
        for (int j = 0; j < 9; ++j) {
          double sum = 0;
          for (int k = 0; k < rank; ++k) sum += factor[i][k] * factor[j][k];
          if (kind == 0) sum = factor[i][j] + factor[j][i];
          if (kind == 3) sum = i == j ? factor[i][i] : 0;
          if (kind == 4) sum = 0;
          one[lane][i][j] = pack[i][j][lane] = sum;
        }
    }
    project_psd<9>(pack);
    for (int lane = 0; lane < kLanes; ++lane) {
      double scale = 1e-300;
      for (const auto& row : one[lane])
        for (const double entry : row) scale = std::max(scale, std::fabs(entry));
      project_psd<9>(one[lane]);
      for (int i = 0; i < 9; ++i)
        for (int j = 0; j < 9; ++j) EXPECT_NEAR(pack[i][j][lane], one[lane][i][j], 1e-13 * scale);
    }
  }
}

TEST(Jacobi, LeavesSemidefiniteMatricesAsTheyAre) {
  double a[9][9] = {};
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < 9; ++j) a[i][j] = (i + 1) * (j + 1) + (i == j && i > 3 ? 1e-3 : 0.0);
  double before[9][9];
  std::memcpy(before, a, sizeof a);
  project_psd<9>(a);
  EXPECT_EQ(std::memcmp(before, a, sizeof a), 0);
}

TEST(Cubic, FirstRootAlongADirection) {
  const double f[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, d[9] = {-2, 0, 0, 0, 0.5, 0, 0, 0, 0};
  double c[4];
  determinant_along(f, d, c);
  EXPECT_NEAR(first_root_in_unit(c), 0.5, 1e-15);
  const double up[9] = {1, 0, 0, 0, 0, 0, 0, 0, 0};
  determinant_along(f, up, c);
  EXPECT_TRUE(std::isinf(first_root_in_unit(c)));
  // Touches zero twice: (1−2s)²(1+s) has its first root at 1/2 although it does not change sign there.
  const double dip[9] = {-2, 0, 0, 0, -2, 0, 0, 0, 1};
  determinant_along(f, dip, c);
  EXPECT_NEAR(first_root_in_unit(c), 0.5, 1e-7);
}

}  // namespace
}  // namespace rhytid
