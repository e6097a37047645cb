// rhytid bench stability: extreme settings one at a time; each must converge or be refused clearly.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_stability_benchmark();

}  // namespace rhytid::tools
