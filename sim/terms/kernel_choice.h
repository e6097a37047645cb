// Kernels of a named instruction set, to compare them; everybody else takes those of kernel_table.h, which are the best
// of this machine.
#pragma once

#include <string_view>

#include "sim/terms/kernel_table.h"

namespace rhytid {

/// Whether this machine and build have the kernels of "avx512", "avx2" or "baseline".
bool has_instructions(std::string_view isa);

/// Kernels of viscoelastic skin for one of them; null where this machine or build has none.
const KernelTable* skin_kernels_of(std::string_view isa);

}  // namespace rhytid
