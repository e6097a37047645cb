// rhytid bench pareto: errors against run time.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_pareto_benchmark();

}  // namespace rhytid::tools
