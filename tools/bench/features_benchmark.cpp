#include "tools/bench/features_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "adjoint/sweeps.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/scene/feature_work.h"
#include "tools/bench/bench_scenes.h"
#include "tools/bench/program_starts.h"
#include "tools/bench/scene_variants.h"
#include "tools/bench/timing.h"
#include "tools/frame_writer.h"
#include "tools/peak_memory.h"

namespace rhytid::tools {
namespace {

/// What a variant took; times of all repeats.
struct VariantCost {
  std::string name, skipped;
  int steps = 0, nodes = 0;
  long iterations = 0, evaluations = 0;
  double peak = 0, states = 0;             ///< MB
  std::vector<double> seconds, processor;  ///< per step: of the clock; of all threads, without waiting
};

/// Features that cost nothing at all here, by their numbers (feature_work.h).
std::string features_without_work(const SceneModel& scene_model) {
  std::string names;
  for (const FeatureWork& work : feature_work(scene_model))
    if (work.is_nothing()) names += (names.empty() ? "" : ", ") + work.feature;
  return names;
}

double bytes_of(const Trajectory& run) {
  double bytes = 0;
  for (const StepRecord& r : run.steps)
    bytes += 8. * static_cast<double>(r.state.u.size() + r.state.history.size() + r.state.velocity.size());
  return bytes;
}

std::string text(double value, const char* pattern = "%.3g") {
  char out[32];
  std::snprintf(out, sizeof out, pattern, value);
  return out;
}

class FeaturesBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "features", "what each feature costs in time, iterations and memory; size and start of the programs",
        "Runs a drag over a patch of skin, or FILE, with all features, and again with one of them left out: "
        "viscosity, ligaments, bone base, friction, contact (the skin under the finger is then moved along "
        "its "
        "path), second layer, Fung's factor; and with one more: pre-stretch, full quadrature, reduced volume "
        "rule, substeps, "
        "files "
        "and pictures, states kept for gradients. Repeats take turns. Then starts rhytid-forward and rhytid. "
        "Writes features.csv, programs.csv and features.md into -o DIR."};
  }
  void add_options(CLI::App& app) override {
    scenes_.add_options(app);
    app.add_option("--repeats", repeats_, "runs of every variant; the median counts (default 3)")
        ->check(CLI::Range(1, 1000));
    app.add_option("--starts", starts_, "starts of each program (default 20)")->check(CLI::Range(1, 10000));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    CsvTable csv({{"scene", ""},
                  {"variant", ""},
                  {"nodes", ""},
                  {"steps", ""},
                  {"time_per_step", "s"},
                  {"fastest", "s"},
                  {"slowest", "s"},
                  {"processor_time_per_step", "s"},
                  {"processor_time_of_full", ""},
                  {"iterations_per_step", ""},
                  {"evaluations_per_step", ""},
                  {"peak", "MB"},
                  {"states", "MB"},
                  {"skipped", ""}});
    for (const BenchScene& one : scenes_.load(context, folder)) {
      const std::vector<SceneVariant> variants = scene_variants(one.scene);
      std::vector<VariantCost> costs(variants.size());
      context.progress.stage(one.name, repeats_ * static_cast<int>(variants.size()));
      int done = 0;
      for (int repeat = 0; repeat < repeats_; ++repeat)
        for (std::size_t k = 0; k < variants.size(); ++k) {
          measure(variants[k], folder + "/files", context, costs[k]);
          if (context.progress.interrupted()) return ExitCode::interrupted;
          context.progress.step_done(++done);
        }
      context.progress.finish();
      add(one.name, costs, csv);
      csv.write(folder + "/features.csv");
      write_file(folder + "/features.md", markdown_);
    }
    add_programs(folder);
    write_file(folder + "/features.md", markdown_);
    context.out << markdown_ << "\n" << folder << "/features.csv\n";
    return ExitCode::ok;
  }

 private:
  static void measure(const SceneVariant& variant, const std::string& files, VerbContext& context,
                      VariantCost& cost) {
    (void)take_peak_memory();
    const SceneModel scene_model(variant.scene);
    RunOptions options = scene_model.run_options();
    options.keep_states = variant.output.states;
    options.keep_histories = variant.output.histories;
    std::optional<FrameWriter> writer;
    if (variant.output.files) writer.emplace(scene_model, files, FrameOptions{});
    RunObserver observer;
    observer.iteration = [&](int, double, int, double, double) { return !context.progress.interrupted(); };
    observer.step = [&](const StepEvent& event) {
      if (writer && event.frame_done) writer->write(event.record.frame, event.state);
    };
    const double before = cpu_seconds();
    const Trajectory run = simulate(scene_model.model(), scene_model.native(), options, observer);
    const double processor = cpu_seconds() - before;
    if (context.progress.interrupted()) return;
    if (!run.complete)
      throw adjoint::GradientError(variant.name + ": the run did not reach its last frame: " + run.failure);
    cost.name = variant.name;
    cost.skipped = features_without_work(scene_model);
    cost.nodes = scene_model.model().num_nodes();
    cost.steps = static_cast<int>(run.steps.size());
    cost.iterations = cost.evaluations = 0;
    for (const StepRecord& r : run.steps) {
      cost.iterations += r.report.iterations;
      cost.evaluations += r.report.evaluations;
    }
    cost.peak = std::max(cost.peak, take_peak_memory().value_or(0));
    cost.states = options.keep_states ? bytes_of(run) / 1e6 : 0;
    cost.seconds.push_back(run.seconds / cost.steps);
    cost.processor.push_back(processor / cost.steps);
  }

  void add(const std::string& scene, const std::vector<VariantCost>& costs, CsvTable& csv) {
    markdown_ += "\n## " + scene + ": " + std::to_string(costs.front().nodes) + " nodes, " +
                 std::to_string(costs.front().steps) + " steps\n\n" +
                 "| variant | s per step | range | processor s per step | of the full one | iterations per "
                 "step | peak of the process, MB | "
                 "states, MB | costs nothing |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
    const double full = median(costs.front().processor);
    for (const VariantCost& c : costs) {
      const auto [fastest, slowest] = std::minmax_element(c.seconds.begin(), c.seconds.end());
      const double middle = median(c.seconds), processor = median(c.processor);
      const double iterations = static_cast<double>(c.iterations) / c.steps;
      csv.add_row({scene, c.name, std::int64_t{c.nodes}, std::int64_t{c.steps}, middle, *fastest, *slowest,
                   processor, processor / full, iterations, static_cast<double>(c.evaluations) / c.steps,
                   c.peak, c.states, c.skipped});
      markdown_ += "| " + c.name + " | " + text(middle) + " | " + text(*fastest) + " .. " + text(*slowest) +
                   " | " + text(processor) + " | " + text(processor / full, "%.2f") + " | " +
                   text(iterations) + " | " + text(c.peak, "%.0f") + " | " +
                   (c.states > 0 ? text(c.states) : "") + " | " + c.skipped + " |\n";
    }
  }

  void add_programs(const std::string& folder) {
    const std::vector<ProgramStart> programs = measure_program_starts(starts_);
    if (programs.empty()) return;
    CsvTable csv({{"program", ""}, {"size", "MB"}, {"libraries", ""}, {"start", "ms"}});
    markdown_ +=
        "\n## Programs\n\n| program | MB | shared libraries | ms from start to end of --version |\n| --- | "
        "--- | --- | "
        "--- |\n";
    for (const ProgramStart& p : programs) {
      csv.add_row({p.name, p.bytes / 1e6, std::int64_t{p.libraries}, p.seconds * 1e3});
      markdown_ += "| `" + p.name + "` | " + text(p.bytes / 1e6) + " | " + std::to_string(p.libraries) +
                   " | " + text(p.seconds * 1e3) + " |\n";
    }
    csv.write(folder + "/programs.csv");
  }

  BenchSceneOptions scenes_{8};
  int repeats_ = 3, starts_ = 20;
  std::string markdown_ = "# What features cost\n";
};

}  // namespace

std::unique_ptr<Benchmark> make_features_benchmark() {
  return std::make_unique<FeaturesBenchmark>();
}

}  // namespace rhytid::tools
