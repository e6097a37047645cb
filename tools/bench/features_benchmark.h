// rhytid bench features: what each feature of a scene costs, and the two programs beside each other.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_features_benchmark();

}  // namespace rhytid::tools
