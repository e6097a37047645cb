// How many threads the simulator uses, and the two loops over them. Results never depend on the thread count:
// iteration i may write only to what belongs to i, and sums over i are done by the caller in index order.
#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <utility>

namespace rhytid {

/// Number of threads for every later parallel_for; at least 1, else ContractError. Process-wide; call it at
/// start or between computations.
void set_num_threads(int count);

/// The number set, or, before any call of set_num_threads, what OpenMP would use (OMP_NUM_THREADS or the
/// cores).
int num_threads();

/// What a parallel loop throws when iterations did: the exception of the lowest of them.
class FirstFailure {
 public:
  /// Within a handler, by any thread: iteration i threw the current exception.
  void note(std::int64_t i) {
#pragma omp critical(rhytid_parallel_failure)
    if (!failure_ || i < index_) {
      index_ = i;
      failure_ = std::current_exception();
    }
  }
  /// After the loop.
  void rethrow() {
    if (failure_) std::rethrow_exception(std::move(failure_));
  }

 private:
  std::int64_t index_ = 0;
  std::exception_ptr failure_;
};

/// Calls fn(i) for i = 0..n−1 on num_threads() threads, in contiguous static chunks. A nested call runs
/// serially. When iterations throw, the exception of the lowest throwing index is rethrown after the loop,
/// whatever the number of threads (the other threads finish their chunks, the throwing one stops there).
template <class Fn>
void parallel_for(std::int64_t n, Fn&& fn) {
  FirstFailure failure;
#pragma omp parallel for schedule(static, 1) num_threads(num_threads())
  for (int chunk = 0; chunk < num_threads(); ++chunk) {
    const std::int64_t count = num_threads(), begin = n * chunk / count, end = n * (chunk + 1) / count;
    std::int64_t i = begin;
    try {
      for (; i < end; ++i) fn(i);
    } catch (...) {
      failure.note(i);
    }
  }
  failure.rethrow();
}

/// The same, with iterations handed out one by one, in order, to whichever thread is free: for work of uneven
/// size. All iterations are tried.
template <class Fn>
void parallel_for_uneven(std::int64_t n, Fn&& fn) {
  FirstFailure failure;
  std::atomic<std::int64_t> next{0};
#pragma omp parallel num_threads(num_threads())
  for (std::int64_t i = next++; i < n; i = next++) {
    try {
      fn(i);
    } catch (...) {
      failure.note(i);
    }
  }
  failure.rethrow();
}

}  // namespace rhytid
