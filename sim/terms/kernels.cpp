// Which compiled kernels answer: the run-time choice of instruction set, and the surface laws.
#include <cstdlib>
#include <string_view>

#include "sim/terms/contact_law.h"
#include "sim/terms/extrapolated_friction_law.h"
#include "sim/terms/kernel_choice.h"
#include "sim/terms/ligament_law.h"
#include "sim/terms/make_kernel_table.h"

namespace rhytid {

// Tables are declared whether or not this build has them.
#define RHYTID_TABLES(name) \
  extern const KernelTable name##_table_baseline, name##_table_avx2, name##_table_avx512;
RHYTID_TABLES(skin)
RHYTID_TABLES(elastic)
RHYTID_TABLES(volume)
RHYTID_TABLES(pre_stretched_skin)
RHYTID_TABLES(pre_stretched_elastic)

namespace {

enum class InstructionSet { baseline, avx2, avx512 };

/// The one of that name, or the best below it that this build and the processor have; the best for an empty name.
InstructionSet available(std::string_view wish) {
#ifdef RHYTID_HAVE_AVX512
  if ((wish.empty() || wish == "avx512") && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    return InstructionSet::avx512;
#endif
#ifdef RHYTID_HAVE_AVX2
  if (wish != "baseline" && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return InstructionSet::avx2;
#endif
  (void)wish;
  return InstructionSet::baseline;
}

/// The best, or what RHYTID_ISA asks for.
InstructionSet chosen() {
  static const InstructionSet set = [] {
    const char* wish = std::getenv("RHYTID_ISA");
    const std::string_view name = wish ? wish : "";
    const bool known = name == "baseline" || name == "avx2" || name == "avx512";
    return available(known ? name : "");
  }();
  return set;
}

const char* name(InstructionSet set) {
  return set == InstructionSet::avx512 ? "avx512" : set == InstructionSet::avx2 ? "avx2" : "baseline";
}

/// What the declarations of tables that this build lacks stand for is never asked for.
#if defined(RHYTID_HAVE_AVX512)
#define RHYTID_TABLE(name, set)                          \
  ((set) == InstructionSet::avx512 ? name##_table_avx512 \
   : (set) == InstructionSet::avx2 ? name##_table_avx2   \
                                   : name##_table_baseline)
#elif defined(RHYTID_HAVE_AVX2)
#define RHYTID_TABLE(name, set) ((set) == InstructionSet::avx2 ? name##_table_avx2 : name##_table_baseline)
#else
#define RHYTID_TABLE(name, set) ((void)(set), name##_table_baseline)
#endif

}  // namespace

const KernelTable& skin_kernels() {
  return RHYTID_TABLE(skin, chosen());
}
const KernelTable& elastic_skin_kernels() {
  return RHYTID_TABLE(elastic, chosen());
}
const KernelTable& volume_kernels() {
  return RHYTID_TABLE(volume, chosen());
}
const KernelTable& pre_stretched_skin_kernels() {
  return RHYTID_TABLE(pre_stretched_skin, chosen());
}
const KernelTable& pre_stretched_elastic_skin_kernels() {
  return RHYTID_TABLE(pre_stretched_elastic, chosen());
}
const char* skin_kernel_isa() {
  return name(chosen());
}
const KernelTable* skin_kernels_of(std::string_view isa) {
  const InstructionSet set = available(isa);
  return isa == name(set) ? &RHYTID_TABLE(skin, set) : nullptr;
}
bool has_instructions(std::string_view isa) {
  return isa == name(available(isa));
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

const KernelTable& extrapolated_friction_kernels() {
  static constexpr KernelTable table = kernel_table<ExtrapolatedFrictionLaw, SurfaceKinematics>();
  return table;
}
const KernelTable& extrapolated_ellipsoid_friction_kernels() {
  static constexpr KernelTable table = kernel_table<ExtrapolatedEllipsoidFrictionLaw, SurfaceKinematics>();
  return table;
}

}  // namespace rhytid
