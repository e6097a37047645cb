// rhytid bench tolerance: what a solver tolerance buys, in positions, in a functional and in its gradient.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_tolerance_benchmark();

}  // namespace rhytid::tools
