#include "tools/bench/benchmark.h"
#include "tools/bench/features_benchmark.h"
#include "tools/bench/gradient_benchmark.h"
#include "tools/bench/kernel_benchmark.h"
#include "tools/bench/memory_benchmark.h"
#include "tools/bench/minimisers_benchmark.h"
#include "tools/bench/pareto_benchmark.h"
#include "tools/bench/stability_benchmark.h"
#include "tools/bench/stages_benchmark.h"
#include "tools/bench/tolerance_benchmark.h"

namespace rhytid::tools {

std::vector<std::unique_ptr<Benchmark>> make_benchmarks() {
  std::vector<std::unique_ptr<Benchmark>> all;
  all.push_back(make_stability_benchmark());
  all.push_back(make_stages_benchmark());
  all.push_back(make_kernel_benchmark());
  all.push_back(make_features_benchmark());
  all.push_back(make_gradient_benchmark());
  all.push_back(make_tolerance_benchmark());
  all.push_back(make_memory_benchmark());
  all.push_back(make_minimisers_benchmark());
  all.push_back(make_pareto_benchmark());
  return all;
}

}  // namespace rhytid::tools
