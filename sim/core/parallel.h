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

/// Calls fn(i) for i = 0..n−1 on num_threads() threads, in contiguous static chunks. A nested call runs
/// serially. When iterations throw, the exception of the lowest throwing index is rethrown after the loop,
/// whatever the number of threads (the other threads finish their chunks, the throwing one stops there).
template <class Fn>
void parallel_for(std::int64_t n, Fn&& fn) {
  std::int64_t first_failure = n;
  std::exception_ptr failure;
#pragma omp parallel for schedule(static, 1) num_threads(num_threads())
  for (int chunk = 0; chunk < num_threads(); ++chunk) {
    const std::int64_t count = num_threads(), begin = n * chunk / count, end = n * (chunk + 1) / count;
    std::int64_t i = begin;
    try {
      for (; i < end; ++i) fn(i);
    } catch (...) {
#pragma omp critical(rhytid_parallel_failure)
      if (i < first_failure) {
        first_failure = i;
        failure = std::current_exception();
      }
    }
  }
  if (failure) std::rethrow_exception(std::move(failure));
}

/// The same, with iterations handed out one by one, in order, to whichever thread is free: for work of uneven
/// size.
template <class Fn>
void parallel_for_uneven(std::int64_t n, Fn&& fn) {
  std::atomic<std::int64_t> next{0};
  std::int64_t first_failure = n;
  std::exception_ptr failure;
#pragma omp parallel num_threads(num_threads())
  for (std::int64_t i = next++; i < n; i = next++) try {
      fn(i);
    } catch (...) {
#pragma omp critical(rhytid_parallel_failure)
      if (i < first_failure) {
        first_failure = i;
        failure = std::current_exception();
      }
    }
  if (failure) std::rethrow_exception(std::move(failure));
}

}  // namespace rhytid
