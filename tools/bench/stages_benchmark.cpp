#include "tools/bench/stages_benchmark.h"

#include <CLI/CLI.hpp>
#include <cstdio>

#include "adjoint/sweeps.h"
#include "sim/core/parallel.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "tools/bench/bench_scenes.h"
#include "tools/bench/stage_times.h"

namespace rhytid::tools {
namespace {

std::string rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return value == 0 ? "" : text;
}

/// What the machine can do on one thread and on all.
struct Machine {
  MachineLimits one, all;
};

class Tables {
 public:
  explicit Tables(const Machine& machine)
      : machine_(machine),
        csv_({{"scene", ""},
              {"nodes", ""},
              {"unknowns", ""},
              {"threads", ""},
              {"stage", ""},
              {"calls_per_step", ""},
              {"time_one_thread", "ms"},
              {"time", "ms"},
              {"times_faster", ""},
              {"share_of_step", ""},
              {"points", ""},
              {"time_per_point", "ns"},
              {"flops", ""},
              {"share_of_fma_peak", ""},
              {"share_of_fma_peak_one_thread", ""},
              {"bytes", ""},
              {"share_of_read_bandwidth", ""},
              {"share_of_read_bandwidth_one_thread", ""}}) {}

  void add(const std::string& scene, const StageReport& report) {
    double step = 0;
    for (const StageTime& s : report.stages) step += s.calls * s.seconds;
    markdown_ +=
        "\n## " + scene + ": " + std::to_string(report.nodes) + " nodes, " + std::to_string(report.points) +
        " points, factor of " + rounded(report.factor_entries / 1e6) + " million entries and " +
        rounded(report.factor_flops / 1e9) + " GFLOP\n\n" + std::to_string(report.iterations) +
        " iterations in " + std::to_string(report.steps) + " steps, " +
        rounded(1e3 * report.run_seconds / report.steps) + " ms a step; calls times stages make " +
        rounded(1e3 * step) + " ms.\n\n| stage | calls in a step | ms, 1 thread | " +
        std::to_string(num_threads()) +
        " threads | times faster | of a step | ns per point | GFLOP/s | of FMA peak | GB/s | of read "
        "bandwidth |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
    for (const StageTime& s : report.stages) {
      const double per_point = s.points > 0 ? s.seconds / s.points * 1e9 : 0;
      const MachineLimits& limits = s.is_serial ? machine_.one : machine_.all;
      const double fma = share(s.flops, s.seconds, limits.fma_flops),
                   read = share(s.bytes, s.seconds, limits.read_bandwidth),
                   of_step = step > 0 ? s.calls * s.seconds / step : 0;
      csv_.add_row({scene, std::int64_t{report.nodes}, std::int64_t{report.unknowns},
                    std::int64_t{num_threads()}, s.name, s.calls, s.one_thread * 1e3, s.seconds * 1e3,
                    s.one_thread / s.seconds, of_step, s.points, per_point, s.flops, fma,
                    share(s.flops, s.one_thread, machine_.one.fma_flops), s.bytes, read,
                    share(s.bytes, s.one_thread, machine_.one.read_bandwidth)});
      markdown_ += "| " + s.name + " | " + rounded(s.calls) + " | " + rounded(s.one_thread * 1e3) + " | " +
                   rounded(s.seconds * 1e3) + " | " + rounded(s.one_thread / s.seconds) + " | " +
                   percent(of_step) + " | " + rounded(per_point) + " | " +
                   rounded(s.flops / s.seconds / 1e9) + " | " + percent(fma) + " | " +
                   rounded(s.bytes / s.seconds / 1e9) + " | " + percent(read) + " |\n";
    }
  }

  std::string markdown() const {
    const auto gflops = [](const MachineLimits& m) { return rounded(m.fma_flops / 1e9) + " GFLOP/s"; };
    const auto reads = [](const MachineLimits& m) { return rounded(m.read_bandwidth / 1e9) + " GB/s"; };
    return "# Stages of a step\n\nFastest call at the end of a drag, with one thread and with " +
           std::to_string(num_threads()) +
           " in turn. Fused multiply-adds of this machine: " + gflops(machine_.one) + " on one thread, " +
           gflops(machine_.all) + " on all; reads from memory: " + reads(machine_.one) + " and " +
           reads(machine_.all) +
           ". Shares are of what all threads can do, or one where a stage never has more; what fits into "
           "caches is read faster than memory. Hessians that were "
           "projected count among the assembled ones. What is listed per term is part of the rows above "
           "it.\n" +
           markdown_;
  }
  void write(const std::string& folder) const {
    csv_.write(folder + "/stages.csv");
    write_file(folder + "/stages.md", markdown());
  }

 private:
  static double share(double amount, double seconds, double limit) {
    return limit > 0 ? amount / seconds / limit : 0;
  }
  static std::string percent(double share) { return share > 0 ? rounded(100 * share) + " %" : ""; }

  Machine machine_;
  CsvTable csv_;
  std::string markdown_;
};

class StagesBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "stages", "where the time of a step goes, stage by stage, beside the machine's limits",
        "Simulates a drag over a patch of skin, or FILE, and times every stage of its last step on its "
        "own: energies and Hessians term by term, assembly, ordering, factorisation, solves, the new "
        "state, blocks of tangent and adjoint; with one thread and with all (--threads N), beside the fused "
        "multiply-adds and the read bandwidth measured in the same run. How often a step of the run calls "
        "each makes a profile of the step. Writes stages.csv and stages.md into -o DIR."};
  }
  void add_options(CLI::App& app) override {
    scenes_.add_options(app);
    app.add_option("--seconds", seconds_, "how long every stage is repeated (default 0.3)")
        ->check(CLI::Range(0., 3600.));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    Tables tables({measure_machine_limits(1), measure_machine_limits(num_threads())});
    const auto go_on = [&] { return !context.progress.interrupted(); };
    for (const BenchScene& one : scenes_.load(context, folder)) {
      context.progress.stage(one.name, 1);
      const SceneModel scene_model(one.scene);
      const std::optional<StageReport> report = measure_stages(scene_model, seconds_, go_on);
      context.progress.finish();
      if (!report) return ExitCode::interrupted;
      tables.add(one.name, *report);
      tables.write(folder);
    }
    context.out << tables.markdown() << "\n" << folder << "/stages.csv\n";
    return ExitCode::ok;
  }

 private:
  BenchSceneOptions scenes_{8};
  double seconds_ = 0.3;
};

}  // namespace

std::unique_ptr<Benchmark> make_stages_benchmark() {
  return std::make_unique<StagesBenchmark>();
}

}  // namespace rhytid::tools
