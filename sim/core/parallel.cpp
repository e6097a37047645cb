#include "sim/core/parallel.h"

#include <omp.h>

#include <atomic>

#include "sim/core/error.h"

namespace rhytid {

namespace {
std::atomic<int> requested_threads{0};  // 0: never set
}

void set_num_threads(int count) {
  require(count >= 1, "set_num_threads: the count must be at least 1");
  requested_threads = count;
}

int num_threads() {
  const int count = requested_threads;
  return count > 0 ? count : omp_get_max_threads();
}

}  // namespace rhytid
