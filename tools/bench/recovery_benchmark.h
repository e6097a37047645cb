// rhytid bench recovery: repeated twin studies.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_recovery_benchmark();

}  // namespace rhytid::tools
