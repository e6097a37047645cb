// What `rhytid bench` runs: one benchmark per subcommand. A new one is a class in tools/bench and a line in
// benchmarks.cpp, or in verb_fitting_bench.cpp when it needs fits; options of its own, files and exit codes work as in a verb.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tools/verb.h"

namespace rhytid::tools {

struct BenchmarkHelp {
  std::string name;         ///< the subcommand
  std::string summary;      ///< a line for the list
  std::string description;  ///< a paragraph: what is measured, what it shows
};

class Benchmark {
 public:
  virtual ~Benchmark() = default;
  virtual BenchmarkHelp help() const = 0;
  virtual void add_options(CLI::App&) {}
  /// Writes tables into `folder` (exists) and a short account to context.out. An adjoint::GradientError (a run
  /// that ended early, or that has no gradient) becomes one line and exit code 3.
  virtual ExitCode run(VerbContext& context, const std::string& folder) = 0;
};

/// Those of the simulator, in the order of the help.
std::vector<std::unique_ptr<Benchmark>> make_benchmarks();

/// `bench` with these. rhytid-forward has those of the simulator, rhytid those of fits too.
std::unique_ptr<Verb> make_bench_verb(std::vector<std::unique_ptr<Benchmark>> benchmarks);

}  // namespace rhytid::tools
