// rhytid bench minimisers: what each minimiser needs for the same run to the same tolerance.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_minimisers_benchmark();

}  // namespace rhytid::tools
