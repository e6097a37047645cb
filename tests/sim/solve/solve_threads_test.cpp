// A factorisation runs on the calling thread alone, and by OpenBLAS.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "sim/core/parallel.h"
#include "sim/solve/blas_info.h"
#include "sim/solve/block_matrix.h"

namespace rhytid {
namespace {

/// Nanoseconds on a processor of every thread of this process, by thread id.
std::map<int, long> processor_time() {
  std::map<int, long> result;
  for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
    long nanoseconds = 0;
    std::ifstream(task.path() / "schedstat") >> nanoseconds;
    result[std::stoi(task.path().filename())] = nanoseconds;
  }
  return result;
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

TEST(SolveThreads, FactorisationStaysOnTheCallingThread) {
  set_num_threads(1);
  const BlockPattern pattern = grid_pattern(61, 5);
  BlockMatrix matrix(pattern);
  for (int c = 0; c < pattern.num_cliques(); ++c) {
    const int m = 3 * static_cast<int>(pattern.clique(c).size());
    const MatrixXd dense = MatrixXd::Ones(m, m) + MatrixXd::Identity(m, m);
    matrix.add(c, dense.data());
  }
  const auto before = processor_time();
  CholeskyFactor factor(pattern);
  for (int repeat = 0; repeat < 4; ++repeat) {
    ASSERT_TRUE(factor.factorize(matrix));
    EXPECT_TRUE(factor.solve(MatrixXd::Ones(pattern.num_unknowns(), 8)).allFinite());
  }
  const auto after = processor_time();
  EXPECT_EQ(after.size(), before.size()) << "threads were started";
  long own = 0, others = 0;
  for (const auto& [id, time] : after)
    (id == getpid() ? own : others) += time - (before.contains(id) ? before.at(id) : 0);
  EXPECT_GT(own, 10'000'000);
  EXPECT_LT(others, own / 100);
}

TEST(BlasInfo, OpenBlasAnswers) {
  const BlasInfo info = blas_info();
  EXPECT_EQ(info.name, "openblas") << info.library;
  EXPECT_NE(info.library.find("openblas"), std::string::npos) << info.library;
  EXPECT_NE(info.config.find("OpenBLAS"), std::string::npos) << info.config;
}

}  // namespace
}  // namespace rhytid
