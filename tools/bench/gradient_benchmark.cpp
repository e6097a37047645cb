#include "tools/bench/gradient_benchmark.h"

#include <CLI/CLI.hpp>
#include <cstdio>

#include "adjoint/sweeps.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "tools/bench/bench_scenes.h"
#include "tools/bench/gradient_cost.h"

namespace rhytid::tools {
namespace {

class Tables {
 public:
  Tables()
      : csv_({{"scene", ""},
              {"nodes", ""},
              {"unknowns", ""},
              {"points", ""},
              {"steps", ""},
              {"iterations", ""},
              {"factorisations", ""},
              {"tight_iterations", ""},
              {"columns", ""},
              {"forward", "s"},
              {"forward_tight", "s"},
              {"adjoint", "s"},
              {"jacobian", "s"},
              {"adjoint_over_forward", ""},
              {"jacobian_over_forward", ""},
              {"duality", ""}}) {}

  void add(const std::string& scene, const GradientCost& c) {
    csv_.add_row({scene, std::int64_t{c.nodes}, std::int64_t{c.unknowns}, std::int64_t{c.points},
                  std::int64_t{c.steps}, std::int64_t{c.iterations}, std::int64_t{c.factorisations},
                  std::int64_t{c.tight_iterations}, std::int64_t{c.columns}, c.forward, c.forward_tight,
                  c.adjoint, c.jacobian, c.adjoint / c.forward, c.jacobian / c.forward, c.duality});
    char row[200];
    std::snprintf(row, sizeof row, " | %d | %d | %d | %.3g | %.3g | %.3g | %.3g | %.3f | %.3f | %.1e |\n",
                  c.nodes, c.steps, c.iterations, c.forward, c.forward_tight, c.adjoint, c.jacobian,
                  c.adjoint / c.forward, c.jacobian / c.forward, c.duality);
    markdown_ += "| " + scene + row;
  }

  std::string markdown() const {
    return "| scene | nodes | steps | iterations | forward, s | tight, s | adjoint, s | Jacobian, s | "
           "adjoint / forward | Jacobian / forward | duality |\n"
           "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n" +
           markdown_;
  }
  void write(const std::string& folder) const {
    csv_.write(folder + "/gradient.csv");
    write_file(folder + "/gradient.md", markdown());
  }

 private:
  CsvTable csv_;
  std::string markdown_;
};

class GradientBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "gradient", "time of an adjoint gradient and of a Jacobian beside the simulation",
        "Simulates a drag over a patch of skin, or FILE, and differentiates it: one adjoint sweep (the "
        "gradient of one functional by everything) and one tangent sweep (the Jacobian by the scene's "
        "first parameters). Parts are timed in turn, medians are reported; 'forward' is the simulation at "
        "the scene's own tolerance, 'tight' the polished one that is differentiated. Exit 3 when a run "
        "does not reach its last frame. Writes gradient.csv and gradient.md into -o DIR."};
  }
  void add_options(CLI::App& app) override {
    scenes_.add_options(app);
    app.add_option("--repeats", cost_.repeats, "measurements of every part (default 3)")
        ->check(CLI::Range(1, 1000));
    app.add_option("--parameters", cost_.parameters, "columns of the Jacobian (default 16)")
        ->check(CLI::Range(1, 1000));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    Tables tables;
    for (const BenchScene& one : scenes_.load(context, folder)) measure(context, one, tables, folder);
    if (context.progress.interrupted()) return ExitCode::interrupted;
    context.out << tables.markdown() << folder << "/gradient.csv\n";
    return ExitCode::ok;
  }

 private:
  void measure(VerbContext& context, const BenchScene& one, Tables& tables, const std::string& folder) {
    if (context.progress.interrupted()) return;
    const SceneModel scene_model(one.scene);
    int part = 0;
    context.progress.stage(one.name + ", " + std::to_string(scene_model.model().num_nodes()) + " nodes",
                           4 * cost_.repeats);
    const std::optional<GradientCost> cost =
        measure_gradient_cost(scene_model, cost_, [&](const std::string& begins) {
          if (!begins.empty() && part++ > 0) context.progress.step_done(part - 1);
          return !context.progress.interrupted();
        });
    context.progress.finish();
    if (!cost) return;
    tables.add(one.name, *cost);
    tables.write(folder);
  }

  BenchSceneOptions scenes_{20};
  GradientCostOptions cost_;
};

}  // namespace

std::unique_ptr<Benchmark> make_gradient_benchmark() {
  return std::make_unique<GradientBenchmark>();
}

}  // namespace rhytid::tools
