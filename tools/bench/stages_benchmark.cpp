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

class Tables {
 public:
  explicit Tables(const MachineLimits& machine)
      : machine_(machine),
        csv_({{"scene", ""},
              {"nodes", ""},
              {"unknowns", ""},
              {"threads", ""},
              {"stage", ""},
              {"time", "ms"},
              {"points", ""},
              {"time_per_point", "ns"},
              {"flops", ""},
              {"share_of_fma_peak", ""},
              {"bytes", ""},
              {"share_of_read_bandwidth", ""}}) {}

  void add(const std::string& scene, const StageReport& report) {
    markdown_ +=
        "\n## " + scene + ": " + std::to_string(report.nodes) + " nodes, " + std::to_string(report.points) +
        " points, factor of " + rounded(report.factor_entries / 1e6) + " million entries and " +
        rounded(report.factor_flops / 1e9) +
        " GFLOP\n\n| stage | ms | ns per point | GFLOP/s | of FMA peak | GB/s | of read bandwidth |\n"
        "| --- | --- | --- | --- | --- | --- | --- |\n";
    for (const StageTime& s : report.stages) {
      const double per_point = s.points > 0 ? s.seconds / s.points * 1e9 : 0;
      const double flops = s.flops / s.seconds, bytes = s.bytes / s.seconds;
      const double fma = machine_.fma_flops > 0 ? flops / (machine_.fma_flops * num_threads()) : 0;
      const double read = bytes / machine_.read_bandwidth;
      csv_.add_row({scene, std::int64_t{report.nodes}, std::int64_t{report.unknowns},
                    std::int64_t{num_threads()}, s.name, s.seconds * 1e3, s.points, per_point, s.flops, fma,
                    s.bytes, read});
      markdown_ += "| " + s.name + " | " + rounded(s.seconds * 1e3) + " | " + rounded(per_point) + " | " +
                   rounded(flops / 1e9) + " | " + rounded(fma) + " | " + rounded(bytes / 1e9) + " | " +
                   rounded(read) + " |\n";
    }
  }

  std::string markdown() const {
    return "# Stages of a step\n\nMedian time of one call with " + std::to_string(num_threads()) +
           " threads, at the end of a drag. One core of this machine: " + rounded(machine_.fma_flops / 1e9) +
           " GFLOP/s of fused multiply-adds, reads " + rounded(machine_.read_bandwidth / 1e9) +
           " GB/s. Shares of the FMA peak are of that of all threads; of the read bandwidth, of one "
           "core's.\n" +
           markdown_;
  }
  void write(const std::string& folder) const {
    csv_.write(folder + "/stages.csv");
    write_file(folder + "/stages.md", markdown());
  }

 private:
  MachineLimits machine_;
  CsvTable csv_;
  std::string markdown_;
};

class StagesBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {"stages", "where the time of a step goes, stage by stage, beside the machine's limits",
            "Simulates a drag over a patch of skin, or FILE, and times every stage of its last step on its "
            "own: energies and Hessians term by term, assembly, ordering, factorisation, solves, the new "
            "state, blocks of tangent and adjoint; beside the fused multiply-adds and the read bandwidth of "
            "one core, measured in the same run. Writes stages.csv and stages.md into -o DIR."};
  }
  void add_options(CLI::App& app) override {
    scenes_.add_options(app);
    app.add_option("--seconds", seconds_, "how long every stage is repeated (default 0.3)")
        ->check(CLI::Range(0., 3600.));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    Tables tables(measure_machine_limits());
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
