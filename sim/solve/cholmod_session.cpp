#include "sim/solve/cholmod_session.h"

#include <omp.h>

#include <mutex>
#include <new>
#include <stdexcept>
#include <string>

extern "C" {
void openblas_set_num_threads(int count);
int openblas_get_num_threads(void);
int openblas_get_parallel(void);  // 0 sequential, 1 own threads, 2 OpenMP
}

namespace rhytid {

namespace {

// The number of OpenBLAS's threads belongs to the process.
std::mutex blas_mutex;
int blas_scopes = 0, blas_threads_before = 1;

}  // namespace

bool blas_is_reentrant() {
  return openblas_get_parallel() != 0;
}

SingleThreadBlas::SingleThreadBlas() {
  const std::lock_guard lock(blas_mutex);
  if (blas_scopes++ > 0) return;
  blas_threads_before = openblas_get_num_threads();
  if (blas_threads_before != 1) openblas_set_num_threads(1);
}

SingleThreadBlas::~SingleThreadBlas() {
  const std::lock_guard lock(blas_mutex);
  if (--blas_scopes == 0 && blas_threads_before != 1) openblas_set_num_threads(blas_threads_before);
}

SingleThreadScope::SingleThreadScope() : active_levels_(omp_get_max_active_levels()) {
  omp_set_max_active_levels(0);
}

SingleThreadScope::~SingleThreadScope() {
  omp_set_max_active_levels(active_levels_);
}

cholmod_sparse lower_pattern(std::size_t size, std::size_t num_entries, const int* column_start,
                             const int* rows) {
  cholmod_sparse pattern{};
  pattern.nrow = pattern.ncol = size;
  pattern.nzmax = num_entries;
  pattern.p = const_cast<int*>(column_start);
  pattern.i = const_cast<int*>(rows);
  pattern.stype = -1;
  pattern.itype = CHOLMOD_INT;
  pattern.xtype = CHOLMOD_PATTERN;
  pattern.dtype = CHOLMOD_DOUBLE;
  pattern.sorted = 1;
  pattern.packed = 1;
  return pattern;
}

void throw_on_cholmod_error(const cholmod_common& common) {
  if (common.status >= CHOLMOD_OK) return;
  if (common.status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
  if (common.status == CHOLMOD_TOO_LARGE)
    throw std::length_error("the factor is too large for 32-bit indices: use a coarser mesh");
  throw std::runtime_error("CHOLMOD failed with status " + std::to_string(common.status));
}

}  // namespace rhytid
