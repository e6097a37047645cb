#include "tools/bench/minimisers_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "tools/bench/bench_scenes.h"
#include "tools/bench/minimiser_run.h"
#include "tools/bench/timing.h"

namespace rhytid::tools {
namespace {

constexpr Minimiser kAll[] = {Minimiser::newton, Minimiser::newton_projected, Minimiser::lbfgs,
                              Minimiser::lbfgs_literal};

/// All repeats of one minimiser on one scene; counts and states are those of the last.
struct Compared {
  Minimiser method;
  MinimiserRun run;
  std::vector<double> seconds, wall_seconds;
  std::vector<std::vector<double>> frame_seconds;  ///< [repeat][frame]

  void add(MinimiserRun next) {
    frame_seconds.push_back(next.frame_seconds);
    seconds.push_back(next.seconds);
    wall_seconds.push_back(next.wall_seconds);
    run = std::move(next);
  }
};

std::string formatted(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

class Tables {
 public:
  Tables()
      : csv_({{"scene", ""},
              {"nodes", ""},
              {"minimiser", ""},
              {"outcome", ""},
              {"frames", ""},
              {"iterations", ""},
              {"evaluations", ""},
              {"factorisations", ""},
              {"failed_factorisations", ""},
              {"cpu", "s"},
              {"wall", "s"},
              {"cpu_over_first", ""},
              {"peak_memory", "MB"},
              {"gradient", "N"},
              {"tolerance", "N"},
              {"largest_displacement_difference", "mm"},
              {"energy", "mJ"},
              {"energy_difference", "mJ"}}),
        frames_csv_({{"scene", ""},
                     {"nodes", ""},
                     {"minimiser", ""},
                     {"frame", ""},
                     {"iterations", ""},
                     {"cpu", "s"},
                     {"cpu_over_first", ""},
                     {"least_ratio", ""},
                     {"largest_ratio", ""}}) {}

  void add(const std::string& scene, int nodes, const Compared& c, const Compared& first) {
    const MinimiserRun& run = c.run;
    const bool both = run.complete && first.run.complete;
    const double cpu = median(c.seconds), ratio = both ? cpu / median(first.seconds) : NAN,
                 difference =
                     std::min(run.frames, first.run.frames) > 0 ? largest_difference(run, first.run) : NAN,
                 energy = both ? run.energy - first.run.energy : NAN;
    std::string outcome = run.complete ? "complete" : "";
    if (!run.trouble.empty()) outcome += (outcome.empty() ? "" : ", ") + run.trouble;
    csv_.add_row({scene, std::int64_t{nodes}, std::string(name(c.method)), outcome, std::int64_t{run.frames},
                  std::int64_t{run.iterations}, std::int64_t{run.evaluations},
                  std::int64_t{run.factorisations}, std::int64_t{run.failed_factorisations}, cpu,
                  median(c.wall_seconds), ratio, run.peak_memory, run.gradient, run.tolerance, difference,
                  run.energy, energy});
    const auto shown = [](const char* format, double value) {
      return std::isfinite(value) ? formatted(format, value) : std::string("-");
    };
    for (std::size_t f = 0; f < run.frame_seconds.size(); ++f) add_frame(scene, nodes, c, first, f);
    markdown_ += "| " + scene + " | " + name(c.method) + " | " + outcome + " | " +
                 std::to_string(run.iterations) + " | " + std::to_string(run.factorisations) + " (" +
                 std::to_string(run.failed_factorisations) + ") | " + std::to_string(run.evaluations) +
                 " | " + formatted("%.3g", cpu) + " | " + shown("%.2f", ratio) + " | " +
                 formatted("%.0f", run.peak_memory) + " | " + formatted("%.1e", run.gradient) + " | " +
                 shown("%.1e", difference) + " | " + shown("%.1e", energy) + " |\n";
  }
  std::string markdown() const {
    return "| scene | minimiser | outcome | iterations | factorisations (failed) | evaluations | CPU s | of "
           "the "
           "first | peak MB | gradient, N | displacement, mm | energy, mJ |\n"
           "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n" +
           markdown_;
  }
  void write(const std::string& folder) const {
    csv_.write(folder + "/minimisers.csv");
    frames_csv_.write(folder + "/minimisers_frames.csv");
    write_file(folder + "/minimisers.md", markdown());
  }

 private:
  /// Ratios are those of the runs of one round, which followed each other.
  void add_frame(const std::string& scene, int nodes, const Compared& c, const Compared& first,
                 std::size_t f) {
    std::vector<double> seconds, ratios;
    for (std::size_t k = 0; k < c.frame_seconds.size(); ++k) {
      if (f >= c.frame_seconds[k].size()) continue;
      seconds.push_back(c.frame_seconds[k][f]);
      if (k < first.frame_seconds.size() && f < first.frame_seconds[k].size() &&
          first.frame_seconds[k][f] > 0)
        ratios.push_back(c.frame_seconds[k][f] / first.frame_seconds[k][f]);
    }
    const auto [least, largest] = std::minmax_element(ratios.begin(), ratios.end());
    frames_csv_.add_row({scene, std::int64_t{nodes}, std::string(name(c.method)),
                         static_cast<std::int64_t>(f) + 1, std::int64_t{c.run.frame_iterations[f]},
                         median(seconds), ratios.empty() ? NAN : median(ratios),
                         ratios.empty() ? NAN : *least, ratios.empty() ? NAN : *largest});
  }

  CsvTable csv_, frames_csv_;
  std::string markdown_;
};

class MinimisersBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "minimisers", "every minimiser on the same run to the same tolerance, the publication's among them",
        "Simulates the first frames of a drag over a patch of skin, or of FILE, once with each minimiser, to "
        "the scene's tolerances: ours (newton), Newton that always projects, our L-BFGS (20 pairs, a new "
        "factor every 20 iterations) and that of the publication (10 pairs, a new factor every 50 iterations "
        "or after a step below 1e-6). Steps are not halved, so one that does not converge ends its run; "
        "that, "
        "and a run longer than --limit, is a row that says so. Each starts its steps from its own states by "
        "the same rule. Differences of displacements and energy are to the first minimiser, seconds are CPU "
        "seconds of all threads (medians). Ours go by factors in single precision where the scene's "
        "/solver/factor_precision has it so, the publication's never. Its own tolerance of the publication "
        "is --set "
        "/solver/relative_tolerance=0 --set /solver/absolute_tolerance=1e-6. Writes minimisers.csv, "
        "minimisers_frames.csv (each frame by itself) and minimisers.md into -o DIR."};
  }
  void add_options(CLI::App& app) override {
    scenes_.add_options(app);
    std::vector<std::string> names;
    for (const Minimiser method : kAll) names.emplace_back(name(method));
    app.add_option("--minimisers", chosen_, "which (default all); the first is what others are compared with")
        ->delimiter(',')
        ->option_text("NAME,...")
        ->check(CLI::IsMember(names));
    app.add_option("--repeats", repeats_, "runs of each, in turn (default 1)")->check(CLI::Range(1, 1000));
    app.add_option("--limit", limit_, "CPU seconds of a run (default 600)")
        ->option_text("S")
        ->check(CLI::Range(0., 1e9));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    std::vector<Minimiser> methods;
    for (const std::string& wanted : chosen_)
      for (const Minimiser method : kAll)
        if (wanted == name(method)) methods.push_back(method);
    if (methods.empty()) methods.assign(std::begin(kAll), std::end(kAll));
    Tables finished;
    for (const BenchScene& one : scenes_.load(context, folder)) {
      const SceneModel scene_model(one.scene);
      const int nodes = scene_model.model().num_nodes();
      const auto rounds = static_cast<int>(methods.size()) * repeats_;
      context.progress.stage(one.name + ", " + std::to_string(nodes) + " nodes", rounds);
      std::vector<Compared> all;
      for (int round = 0; round < rounds; ++round) {
        const std::size_t k = static_cast<std::size_t>(round) % methods.size();
        if (round < static_cast<int>(methods.size())) all.push_back({methods[k], {}, {}, {}, {}});
        all[k].add(run_minimiser(scene_model,
                                 minimiser_to_compare(methods[k], scene_model.run_options().minimiser),
                                 limit_, [&] { return !context.progress.interrupted(); }));
        if (context.progress.interrupted()) return ExitCode::interrupted;
        context.progress.step_done(round + 1);
        // What is known so far: a long comparison may be stopped.
        Tables so_far = finished;
        for (const Compared& c : all) so_far.add(one.name, nodes, c, all.front());
        so_far.write(folder);
        if (round + 1 == rounds) finished = so_far;
      }
      context.progress.finish();
    }
    context.out << finished.markdown() << folder << "/minimisers.csv\n";
    return ExitCode::ok;
  }

 private:
  BenchSceneOptions scenes_{8};
  std::vector<std::string> chosen_;
  int repeats_ = 1;
  double limit_ = 600;
};

}  // namespace

std::unique_ptr<Benchmark> make_minimisers_benchmark() {
  return std::make_unique<MinimisersBenchmark>();
}

}  // namespace rhytid::tools
