// rhytid bench with the benchmarks of fits beside those of the simulator.
#include "tools/bench/benchmark.h"
#include "tools/bench/recovery_benchmark.h"
#include "tools/bench/tracker_benchmark.h"

namespace rhytid::tools {

std::unique_ptr<Verb> make_verb_fitting_bench() {
  std::vector<std::unique_ptr<Benchmark>> all = make_benchmarks();
  all.push_back(make_recovery_benchmark());
  all.push_back(make_tracker_benchmark());
  return make_bench_verb(std::move(all));
}

}  // namespace rhytid::tools
