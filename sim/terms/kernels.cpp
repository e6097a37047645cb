// Which compiled kernels answer: the run-time choice of instruction set, and the surface laws.
#include <cstdlib>
#include <cstring>

#include "sim/terms/contact_law.h"
#include "sim/terms/kernel_choice.h"
#include "sim/terms/ligament_law.h"
#include "sim/terms/make_kernel_table.h"

namespace rhytid {

#ifdef RHYTID_HAVE_AVX2
#define RHYTID_TABLES(name) extern const KernelTable name##_table_baseline, name##_table_avx2;
#define RHYTID_CHOSEN(name) use_avx2() ? name##_table_avx2 : name##_table_baseline
#else
#define RHYTID_TABLES(name) extern const KernelTable name##_table_baseline;
#define RHYTID_CHOSEN(name) name##_table_baseline
#endif
RHYTID_TABLES(skin)
RHYTID_TABLES(elastic)
RHYTID_TABLES(volume)
RHYTID_TABLES(pre_stretched_skin)
RHYTID_TABLES(pre_stretched_elastic)

namespace {

bool has_avx2() {
#ifdef RHYTID_HAVE_AVX2
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
  return false;
#endif
}

/// AVX2 unless the processor lacks it or RHYTID_ISA=baseline asks for the portable kernels.
bool use_avx2() {
  static const bool yes = [] {
    const char* wish = std::getenv("RHYTID_ISA");
    if (wish && std::strcmp(wish, "baseline") == 0) return false;
    return has_avx2();
  }();
  return yes;
}

}  // namespace

const KernelTable& skin_kernels() {
  return RHYTID_CHOSEN(skin);
}
const KernelTable& elastic_skin_kernels() {
  return RHYTID_CHOSEN(elastic);
}
const KernelTable& volume_kernels() {
  return RHYTID_CHOSEN(volume);
}
const KernelTable& pre_stretched_skin_kernels() {
  return RHYTID_CHOSEN(pre_stretched_skin);
}
const KernelTable& pre_stretched_elastic_skin_kernels() {
  return RHYTID_CHOSEN(pre_stretched_elastic);
}
const char* skin_kernel_isa() {
  return use_avx2() ? "avx2" : "baseline";
}
const KernelTable* skin_kernels_of(std::string_view isa) {
  if (isa == "baseline") return &skin_table_baseline;
#ifdef RHYTID_HAVE_AVX2
  if (isa == "avx2" && has_avx2()) return &skin_table_avx2;
#endif
  return nullptr;
}

const KernelTable& ligament_kernels() {
  static constexpr KernelTable table = kernel_table<LigamentLaw, SurfaceKinematics>();
  return table;
}
const KernelTable& fung_ligament_kernels() {
  static constexpr KernelTable table = kernel_table<FungLigamentLaw, SurfaceKinematics>();
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

const KernelTable& ellipsoid_contact_kernels() {
  static constexpr KernelTable table = kernel_table<EllipsoidContactLaw, SurfaceKinematics>();
  return table;
}
const KernelTable& ellipsoid_friction_kernels() {
  static constexpr KernelTable table = kernel_table<EllipsoidFrictionLaw, SurfaceKinematics>();
  return table;
}

}  // namespace rhytid
