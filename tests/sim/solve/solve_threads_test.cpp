// A factorisation runs on as many threads as asked for, with the same bits for any number, and by OpenBLAS.
#include <gtest/gtest.h>

#include <chrono>
#include <ctime>
#include <filesystem>
#include <iterator>
#include <limits>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

#include "sim/core/parallel.h"
#include "sim/solve/blas_info.h"
#include "sim/solve/block_matrix.h"

namespace rhytid {
namespace {

double seconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::ptrdiff_t number_of_threads() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return std::distance(begin(tasks), end(tasks));
}

/// A grid of n × n nodes in cliques of `width` × `width`, large enough for CHOLMOD's parallel loops.
BlockPattern grid_pattern(int n, int width) {
  std::vector<std::vector<int>> cliques;
  for (int y = 0; y + width <= n; y += width - 1)
    for (int x = 0; x + width <= n; x += width - 1) {
      std::vector<int> clique;
      for (int j = 0; j < width; ++j)
        for (int i = 0; i < width; ++i) clique.push_back((y + j) * n + x + i);
      cliques.push_back(clique);
    }
  return BlockPattern(n * n, cliques);
}

class SolveThreads : public ::testing::Test {
 protected:
  void TearDown() override { set_num_threads(before_); }
  int before_ = num_threads();
};

/// A positive definite matrix over a pattern, other numbers in every clique.
BlockMatrix random_matrix(const BlockPattern& pattern) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  BlockMatrix matrix(pattern);
  for (int c = 0; c < pattern.num_cliques(); ++c) {
    const int m = 3 * static_cast<int>(pattern.clique(c).size());
    const MatrixXd half = MatrixXd::NullaryExpr(m, m, [&] { return uniform(random); });
    const MatrixXd dense = half * half.transpose() + 0.1 * MatrixXd::Identity(m, m);
    matrix.add(c, dense.data());
  }
  return matrix;
}

TEST_F(SolveThreads, SameBitsForAnyNumberOfThreads) {
  // A top supernode of several panels, and subtrees below it; large enough for solves on several threads.
  const BlockPattern pattern = grid_pattern(85, 5);
  const BlockMatrix matrix = random_matrix(pattern);
  const VectorXd rhs = VectorXd::LinSpaced(pattern.num_unknowns(), -1, 1);
  MatrixXd several(pattern.num_unknowns(), 5);
  for (int k = 0; k < 5; ++k) several.col(k) = rhs.array().pow(k);
  for (const Precision precision : {Precision::full, Precision::single}) {
    std::vector<MatrixXd> solutions, solutions_of_several;
    std::vector<double> pivots;
    for (const int threads : {1, 2, 3, 5, 2}) {
      set_num_threads(threads);
      CholeskyFactor factor(pattern);
      for (int repeat = 0; repeat < 3; ++repeat) {
        ASSERT_TRUE(factor.factorize(matrix, 0, precision));
        solutions.push_back(factor.solve(rhs));
        solutions_of_several.push_back(factor.solve(several));
        pivots.push_back(factor.smallest_pivot());
      }
    }
    EXPECT_LE((matrix.multiply(solutions[0].col(0)) - rhs).norm(),
              (precision == Precision::full ? 1e-10 : 1e-3) * rhs.norm());
    const double rounding = precision == Precision::full ? 1e-10 : 1e-3;
    EXPECT_LE((solutions_of_several[0].col(1) - solutions[0]).norm(), rounding * solutions[0].norm());
    for (int k = 0; k < 5; ++k)
      EXPECT_LE((matrix.multiply(solutions_of_several[0].col(k)) - several.col(k)).norm(),
                rounding * several.col(k).norm());
    for (std::size_t k = 1; k < solutions.size(); ++k) {
      EXPECT_TRUE(solutions_of_several[k] == solutions_of_several[0]) << k;
      EXPECT_TRUE(solutions[k] == solutions[0]) << k;
      EXPECT_EQ(pivots[k], pivots[0]) << k;
    }
  }
}

TEST_F(SolveThreads, RefusesAndRecoversOnAnyNumberOfThreads) {
  const BlockPattern pattern = grid_pattern(41, 5);
  const BlockMatrix good = random_matrix(pattern);
  for (const int threads : {1, 2, 4}) {
    set_num_threads(threads);
    CholeskyFactor factor(pattern);
    for (const int unknown : {0, pattern.num_unknowns() / 2, pattern.num_unknowns() - 1}) {
      // One negative diagonal entry, wherever it lies in the elimination order.
      BlockMatrix bad = good;
      bad.fix(unknown);
      for (double& v : bad.values())
        if (v == 1.0) v = -1;
      EXPECT_FALSE(factor.factorize(bad)) << unknown;
      EXPECT_FALSE(factor.usable());
      EXPECT_TRUE(factor.factorize(good));
    }
  }
}

/// One supernode of several panels: 450 unknowns that all couple.
TEST_F(SolveThreads, WideSupernodesAndNestedLoops) {
  std::vector<int> all(150);
  std::iota(all.begin(), all.end(), 0);
  const BlockPattern pattern(150, {all});
  const BlockMatrix good = random_matrix(pattern);
  const VectorXd rhs = VectorXd::LinSpaced(pattern.num_unknowns(), -1, 1);
  MatrixXd expected;
  for (const int threads : {1, 2, 3, 7}) {
    set_num_threads(threads);
    CholeskyFactor factor(pattern);
    // A bad pivot in any panel, and numbers that are none; those that wait for it are let go.
    for (const double bad_value : {-1e6, std::numeric_limits<double>::quiet_NaN()})
      for (const std::size_t entry : {std::size_t{0}, good.values().size() / 2, good.values().size() - 1}) {
        BlockMatrix bad = good;
        bad.values()[entry] = bad_value;
        EXPECT_FALSE(factor.factorize(bad)) << threads << ' ' << entry;
      }
    ASSERT_TRUE(factor.factorize(good));
    if (expected.size() == 0) expected = factor.solve(rhs);
    EXPECT_TRUE(factor.solve(rhs) == expected) << threads;
    // Within a parallel loop the inner one is serial: nobody may wait for a thread that never comes.
    parallel_for(2, [&](std::int64_t i) {
      if (i != 0) return;
      EXPECT_TRUE(factor.factorize(good));
    });
    EXPECT_TRUE(factor.solve(rhs) == expected) << threads;
  }
}

TEST_F(SolveThreads, FactorisationStaysOnTheCallingThread) {
  set_num_threads(1);
  const BlockPattern pattern = grid_pattern(61, 5);
  BlockMatrix matrix(pattern);
  for (int c = 0; c < pattern.num_cliques(); ++c) {
    const int m = 3 * static_cast<int>(pattern.clique(c).size());
    const MatrixXd dense = MatrixXd::Ones(m, m) + MatrixXd::Identity(m, m);
    matrix.add(c, dense.data());
  }
  // OpenBLAS starts its workers when it is loaded, and they spin for a moment before they sleep.
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const std::ptrdiff_t threads = number_of_threads();
  const double own_before = seconds(CLOCK_THREAD_CPUTIME_ID), all_before = seconds(CLOCK_PROCESS_CPUTIME_ID);
  CholeskyFactor factor(pattern);
  for (int repeat = 0; repeat < 8; ++repeat) {
    ASSERT_TRUE(factor.factorize(matrix));
    EXPECT_TRUE(factor.solve(MatrixXd::Ones(pattern.num_unknowns(), 8)).allFinite());
  }
  const double own = seconds(CLOCK_THREAD_CPUTIME_ID) - own_before;
  const double all = seconds(CLOCK_PROCESS_CPUTIME_ID) - all_before;
  EXPECT_EQ(number_of_threads(), threads) << "threads were started";
  EXPECT_GT(own, 0.05);
  EXPECT_LT(all - own, 0.05 * own) << "processor seconds outside the calling thread, of " << all;
}

TEST(BlasInfo, OpenBlasAnswers) {
  const BlasInfo info = blas_info();
  EXPECT_EQ(info.name, "openblas") << info.shared_object;
  EXPECT_NE(info.shared_object.find("openblas"), std::string::npos) << info.shared_object;
  EXPECT_NE(info.config.find("OpenBLAS"), std::string::npos) << info.config;
}

}  // namespace
}  // namespace rhytid
