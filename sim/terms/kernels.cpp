// Which compiled kernels answer: the run-time choice of instruction set, and the surface laws.
#include <cstdlib>
#include <cstring>

#include "sim/terms/contact_law.h"
#include "sim/terms/kernel_table.h"
#include "sim/terms/ligament_law.h"

namespace rhytid {

extern const KernelTable skin_table_baseline, elastic_table_baseline;
#ifdef RHYTID_HAVE_AVX2
extern const KernelTable skin_table_avx2, elastic_table_avx2;
#endif

namespace {

/// AVX2 unless the processor lacks it or RHYTID_ISA=baseline asks for the portable kernels.
bool use_avx2() {
#ifdef RHYTID_HAVE_AVX2
  static const bool yes = [] {
    const char* wish = std::getenv("RHYTID_ISA");
    if (wish && std::strcmp(wish, "baseline") == 0) return false;
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  }();
  return yes;
#else
  return false;
#endif
}

}  // namespace

#ifdef RHYTID_HAVE_AVX2
const KernelTable& skin_kernels() {
  return use_avx2() ? skin_table_avx2 : skin_table_baseline;
}
const KernelTable& elastic_skin_kernels() {
  return use_avx2() ? elastic_table_avx2 : elastic_table_baseline;
}
#else
const KernelTable& skin_kernels() {
  return skin_table_baseline;
}
const KernelTable& elastic_skin_kernels() {
  return elastic_table_baseline;
}
#endif
const char* skin_kernel_isa() {
  return use_avx2() ? "avx2" : "baseline";
}

const KernelTable& ligament_kernels() {
  static constexpr KernelTable table = kernel_table<LigamentLaw, SurfaceKinematics>();
  return table;
}
const KernelTable& contact_kernels() {
  static constexpr KernelTable table = kernel_table<ContactLaw, SurfaceKinematics>();
  return table;
}
const KernelTable& friction_kernels() {
  static constexpr KernelTable table = kernel_table<FrictionLaw, SurfaceKinematics>();
  return table;
}

}  // namespace rhytid
