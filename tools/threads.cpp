#include "tools/threads.h"

#include <omp.h>

#include "sim/core/parallel.h"

extern "C" void openblas_set_num_threads(int num_threads);

namespace rhytid::tools {

int available_threads() {
  return omp_get_num_procs();
}

void use_threads(int n) {
  set_num_threads(n);
  omp_set_num_threads(n);  // Eigen and other users of OpenMP
  openblas_set_num_threads(n);
}

}  // namespace rhytid::tools
