// rhytid bench memory: what a run and its adjoint hold, with all histories and within budgets.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_memory_benchmark();

}  // namespace rhytid::tools
