// rhytid bench stages: where the time of a step goes, beside what the machine can do.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_stages_benchmark();

}  // namespace rhytid::tools
