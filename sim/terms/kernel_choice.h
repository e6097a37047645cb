// Kernels of a named instruction set, to compare them; everybody else takes those of kernel_table.h, which are the best
// of this machine.
#pragma once

#include <string_view>

#include "sim/terms/kernel_table.h"

namespace rhytid {

/// Kernels of viscoelastic skin for "avx2" or "baseline"; null where this machine or build has none.
const KernelTable* skin_kernels_of(std::string_view isa);

}  // namespace rhytid
