// rhytid bench: benchmarks of the simulator, one per subcommand (tools/bench).
#include <CLI/CLI.hpp>

#include "adjoint/sweeps.h"
#include "sim/core/error.h"
#include "tools/bench/benchmark.h"

namespace rhytid::tools {
namespace {

class Bench : public Verb {
 public:
  explicit Bench(std::vector<std::unique_ptr<Benchmark>> benchmarks) : benchmarks_(std::move(benchmarks)) {}

  VerbHelp help() const override {
    return {"bench",
            "benchmarks of the simulator: stability, stages, kernels, features, gradients, tolerances, "
            "memory, minimisers, errors "
            "against time, and of fits (in rhytid): recovery",
            "Runs one benchmark and writes its tables. `stability` takes every setting to its extremes on a "
            "small scene, `kernels` compares the element kernels with plain ones, `pareto` runs an "
            "experiment file, `recovery` repeats twin experiments of cases; the others measure a drag over a "
            "patch of any "
            "size, or a scene of yours (--scene).",
            "nothing",
            "tables (CSV, Markdown) into -o DIR, and a short account on stdout",
            "rhytid bench stability --quick -o run/stability"};
  }
  bool takes_file() const override { return false; }

  void add_options(CLI::App& app) override {
    app.require_subcommand(0, 1);
    app.add_option("name", unknown_, "which one, as listed below")->option_text("NAME");
    app.fallthrough();
    app.add_option("-o,--output", output_, "folder for results (default run/bench_<name>)")
        ->option_text("DIR");
    for (const auto& benchmark : benchmarks_) {
      const BenchmarkHelp text = benchmark->help();
      CLI::App* sub = app.add_subcommand(text.name, text.summary);
      sub->footer(text.description);
      sub->fallthrough();
      benchmark->add_options(*sub);
      sub->callback([this, chosen = benchmark.get()] { chosen_ = chosen; });
    }
  }

  ExitCode run(VerbContext& context) override {
    if (chosen_ == nullptr) {
      std::string names;
      for (const auto& benchmark : benchmarks_) names += (names.empty() ? "" : ", ") + benchmark->help().name;
      throw InputError("bench", unknown_.empty() ? "nothing" : "'" + unknown_ + "'", "one of " + names);
    }
    CommonOptions options = context.options;
    options.output = output_.empty() ? "run/bench_" + chosen_->help().name : output_;
    VerbContext own{options, context.program, context.progress, context.out};
    try {
      return chosen_->run(own, own.output_folder());
    } catch (const adjoint::GradientError& error) {
      context.progress.error(error.what());
      return ExitCode::not_converged;
    }
  }

 private:
  std::vector<std::unique_ptr<Benchmark>> benchmarks_;
  Benchmark* chosen_ = nullptr;
  std::string output_, unknown_;
};

}  // namespace

std::unique_ptr<Verb> make_bench_verb(std::vector<std::unique_ptr<Benchmark>> benchmarks) {
  return std::make_unique<Bench>(std::move(benchmarks));
}

std::unique_ptr<Verb> make_verb_bench() {
  return make_bench_verb(make_benchmarks());
}

}  // namespace rhytid::tools
