#include "tools/bench/memory_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>

#include "adjoint/certificate.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "tools/bench/bench_scenes.h"
#include "tools/peak_memory.h"

namespace rhytid::tools {
namespace {

class MemoryBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "memory", "memory and time of a run and its adjoint, all states kept or within a budget",
        "Simulates a drag over a patch of skin, or FILE, twice: keeping every state with its history, and "
        "keeping displacements alone. Then differentiates the first, and the second within budgets that "
        "hold 3, 10 and 30 states and without a limit; histories that were dropped are recomputed at "
        "binomial distances. Reports peaks of resident memory, bytes of states, seconds, and whether the "
        "gradients are the same bits. Writes memory.csv and memory.md into -o DIR."};
  }
  void add_options(CLI::App& app) override { scenes_.add_options(app); }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    CsvTable csv({{"scene", ""},
                  {"nodes", ""},
                  {"steps", ""},
                  {"part", ""},
                  {"time", "s"},
                  {"states", "MB"},
                  {"recomputed_steps", ""},
                  {"peak", "MB"},
                  {"same_bits", ""}});
    std::string markdown =
        "| scene | nodes | steps | part | s | states, MB | recomputed steps | peak of the process, MB | same "
        "bits |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
    ExitCode code = ExitCode::ok;
    for (const BenchScene& one : scenes_.load(context, folder)) {
      const SceneModel scene_model(one.scene);
      const Model& model = scene_model.model();
      const VectorXd native = scene_model.native();
      const auto output = adjoint::default_output(model);
      RunOptions options = scene_model.run_options();
      options.minimiser = adjoint::certificate_minimiser(options.minimiser);
      RunObserver observer;
      observer.iteration = [&](int, double, int, double, double) { return !context.progress.interrupted(); };
      observer.step = [&](const StepEvent& event) {
        if (event.frame_done && event.record.frame > 0) context.progress.step_done(event.record.frame);
      };
      const auto add = [&](const Trajectory& run, const std::string& part, double seconds, double states,
                           long recomputed, const std::string& same) {
        const double peak = take_peak_memory().value_or(0);
        csv.add_row({one.name, std::int64_t{model.num_nodes()}, static_cast<std::int64_t>(run.steps.size()),
                     part, seconds, states, std::int64_t{recomputed}, peak, same});
        char row[200];
        std::snprintf(row, sizeof row, " | %d | %zu | %s | %.3g | %.4g | %ld | %.0f | %s |\n",
                      model.num_nodes(), run.steps.size(), part.c_str(), seconds, states, recomputed, peak,
                      same.c_str());
        markdown += "| " + one.name + row;
        csv.write(folder + "/memory.csv");
        write_file(folder + "/memory.md", markdown);
      };
      VectorXd first_gradient;
      for (const bool keep : {true, false}) {
        options.keep_histories = keep;
        context.progress.stage(one.name + (keep ? ", all states" : ", displacements"), options.frames);
        (void)take_peak_memory();
        const Trajectory run = simulate(model, native, options, observer);
        context.progress.finish();
        if (context.progress.interrupted()) return ExitCode::interrupted;
        if (!run.complete)
          throw adjoint::GradientError("the run did not reach its last frame: " + run.failure);
        double bytes = 0;
        for (const StepRecord& record : run.steps)
          bytes += 8. * static_cast<double>(record.state.u.size() + record.state.history.size() +
                                            record.state.velocity.size());
        add(run, keep ? "run: all states" : "run: displacements alone", run.seconds, bytes / 1e6, 0, "");
        const std::vector<VectorXd> weights = adjoint::random_weights(*output, run.frames(), 1);
        const auto state_bytes =
            static_cast<std::size_t>(8 * (3 * model.num_nodes() + static_cast<long>(model.history_size())));
        for (const int states : keep ? std::vector<int>{0} : std::vector<int>{0, 30, 10, 3}) {
          context.progress.stage("adjoint", 1);
          (void)take_peak_memory();
          const std::size_t budget = states == 0 ? adjoint::ReverseStates::unlimited
                                                 : state_bytes * static_cast<std::size_t>(states);
          const adjoint::AdjointResult result =
              adjoint::adjoint_sweep_within(budget, model, native, run, *output, weights);
          context.progress.finish();
          if (context.progress.interrupted()) return ExitCode::interrupted;
          if (first_gradient.size() == 0) first_gradient = result.native_bar;
          const bool same = result.native_bar == first_gradient;
          if (!same) code = ExitCode::not_converged;
          add(run,
              keep          ? "adjoint of all states"
              : states == 0 ? "adjoint: all recomputed at once"
                            : "adjoint: budget of " + std::to_string(states) + " states",
              result.report.seconds, static_cast<double>(result.checkpoints.held_bytes) / 1e6,
              result.checkpoints.recomputed_steps, same ? "yes" : "NO");
        }
      }
    }
    context.out << markdown << folder << "/memory.csv\n";
    return code;
  }

 private:
  BenchSceneOptions scenes_{100};
};

}  // namespace

std::unique_ptr<Benchmark> make_memory_benchmark() {
  return std::make_unique<MemoryBenchmark>();
}

}  // namespace rhytid::tools
