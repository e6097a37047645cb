// rhytid bench tracker: the tracker on footage of known motion under bad light, blur, head motion and occlusion.
#pragma once

#include "tools/bench/benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Benchmark> make_tracker_benchmark();

}  // namespace rhytid::tools
