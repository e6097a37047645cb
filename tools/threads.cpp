#include "tools/threads.h"

#include <omp.h>
#include <sys/auxv.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <string_view>

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

namespace {

/// Started anew, a process bears the name of the link that it was started from.
void take_back_name(const char* path) {
  char name[16] = {};  // all that the system keeps
  if (prctl(PR_GET_NAME, name) != 0 || std::string_view(name) != "exe") return;
  const char* slash = std::strrchr(path, '/');
  prctl(PR_SET_NAME, slash ? slash + 1 : path);
}

}  // namespace

void let_waiting_threads_sleep(int argc, char** argv) {
  if (argc > 0) take_back_name(argv[0]);
  if (argc < 2 || argv[1][0] == '-') return;  // --help, --version
  if (std::getenv("OMP_WAIT_POLICY") || std::getenv("GOMP_SPINCOUNT")) return;
  // No loader of its own: /proc/self/exe is then the loader, not this program.
  if (getauxval(AT_BASE) == 0) return;
  if (setenv("OMP_WAIT_POLICY", "passive", 0) != 0) return;
  execv("/proc/self/exe", argv);
}

}  // namespace rhytid::tools
