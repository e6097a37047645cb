// rhytid bench kernels: the element kernels against plain references.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_kernel_benchmark();

}  // namespace rhytid::tools
