#include "tools/bench/benchmark.h"
#include "tools/bench/stability_benchmark.h"

namespace rhytid::tools {

std::vector<std::unique_ptr<Benchmark>> make_benchmarks() {
  std::vector<std::unique_ptr<Benchmark>> all;
  all.push_back(make_stability_benchmark());
  return all;
}

}  // namespace rhytid::tools
