// The prism kernels of every instruction set that this machine and build have.
#pragma once

#include <string>
#include <vector>

#include "sim/terms/kernel_choice.h"

namespace rhytid {
// Those that this build has: tests ask has_instructions() before they use one.
#define RHYTID_DECLARE_TABLES(isa)                                                    \
  extern const KernelTable skin_table_##isa, elastic_table_##isa, volume_table_##isa, \
      pre_stretched_skin_table_##isa, pre_stretched_elastic_table_##isa;
RHYTID_DECLARE_TABLES(baseline)
RHYTID_DECLARE_TABLES(avx2)
RHYTID_DECLARE_TABLES(avx512)
#undef RHYTID_DECLARE_TABLES
}  // namespace rhytid

namespace rhytid::test {

/// The prism kernels of one instruction set.
struct PrismTables {
  std::string isa;
  const KernelTable &skin, &elastic, &volume, &pre_stretched_skin, &pre_stretched_elastic;
};
#define RHYTID_PRISM_TABLES(isa)                                                                     \
  PrismTables {                                                                                      \
#isa, skin_table_##isa, elastic_table_##isa, volume_table_##isa, pre_stretched_skin_table_##isa, \
        pre_stretched_elastic_table_##isa                                                            \
  }
/// All that this machine and build have, the portable ones first.
inline std::vector<PrismTables> instruction_sets() {
  std::vector<PrismTables> all = {RHYTID_PRISM_TABLES(baseline)};
#ifdef RHYTID_HAVE_AVX2
  if (has_instructions("avx2")) all.push_back(RHYTID_PRISM_TABLES(avx2));
#endif
#ifdef RHYTID_HAVE_AVX512
  if (has_instructions("avx512")) all.push_back(RHYTID_PRISM_TABLES(avx512));
#endif
  return all;
}
#undef RHYTID_PRISM_TABLES

}  // namespace rhytid::test
