#include "sim/core/parallel.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <set>
#include <stdexcept>
#include <vector>

#include "sim/core/error.h"

namespace rhytid {
namespace {

class ParallelTest : public ::testing::Test {
 protected:
  void TearDown() override { set_num_threads(before_); }
  int before_ = num_threads();
};

TEST_F(ParallelTest, VisitsEveryIndexOnceWhateverTheThreads) {
  for (const int threads : {1, 2, 3, 7}) {
    set_num_threads(threads);
    EXPECT_EQ(num_threads(), threads);
    for (const int n : {0, 1, 2, 5, 1000}) {
      std::vector<int> visits(n, 0);
      parallel_for(n, [&](std::int64_t i) { ++visits[i]; });
      EXPECT_EQ(visits, std::vector<int>(n, 1)) << threads << " threads, n = " << n;
    }
  }
}

TEST_F(ParallelTest, RunsOnTheAskedNumberOfThreads) {
  for (const int threads : {1, 2, 3}) {
    set_num_threads(threads);
    std::vector<int> owner(60, -1);
    parallel_for(60, [&](std::int64_t i) { owner[i] = omp_get_thread_num(); });
    EXPECT_EQ(std::set<int>(owner.begin(), owner.end()).size(), static_cast<std::size_t>(threads));
    EXPECT_TRUE(std::is_sorted(owner.begin(), owner.end())) << "chunks must be contiguous";
  }
}

TEST_F(ParallelTest, RethrowsTheLowestFailureForAnyNumberOfThreads) {
  for (const int threads : {1, 2, 4}) {
    set_num_threads(threads);
    try {
      parallel_for(100, [](std::int64_t i) {
        if (i == 17 || i == 60 || i == 99) throw std::runtime_error("index " + std::to_string(i));
      });
      FAIL() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "index 17");
    }
  }
}

TEST_F(ParallelTest, UnevenWorkIsVisitedOnceAndFailsByTheLowestIndex) {
  for (const int threads : {1, 2, 3}) {
    set_num_threads(threads);
    for (const int n : {0, 1, 5, 1000}) {
      std::vector<int> visits(static_cast<std::size_t>(n), 0);
      parallel_for_uneven(n, [&](std::int64_t i) { ++visits[static_cast<std::size_t>(i)]; });
      EXPECT_EQ(visits, std::vector<int>(static_cast<std::size_t>(n), 1));
    }
    try {
      parallel_for_uneven(50, [](std::int64_t i) {
        if (i % 10 == 7) throw std::runtime_error("index " + std::to_string(i));
      });
      FAIL() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "index 7");
    }
  }
}

TEST_F(ParallelTest, NestedLoopsRun) {
  set_num_threads(2);
  std::vector<int> sums(8, 0);
  parallel_for(8, [&](std::int64_t i) {
    std::vector<int> inner(10, 0);
    parallel_for(10, [&](std::int64_t j) { inner[j] = static_cast<int>(j); });
    for (const int v : inner) sums[i] += v;
  });
  EXPECT_EQ(sums, std::vector<int>(8, 45));
}

TEST_F(ParallelTest, RefusesNoThreads) {
  EXPECT_THROW(set_num_threads(0), ContractError);
}

}  // namespace
}  // namespace rhytid
