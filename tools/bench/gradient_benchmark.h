// rhytid bench gradient: what an adjoint gradient and a Jacobian cost beside the simulation.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_gradient_benchmark();

}  // namespace rhytid::tools
