#include "tools/bench/tolerance_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "adjoint/certificate.h"
#include "adjoint/output_values.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "tools/bench/bench_scenes.h"
#include "tools/bench/gradient_cost.h"

namespace rhytid::tools {
namespace {

/// A run to some tolerance and what its derivatives say.
struct Measured {
  Trajectory run;
  double value = 0;      ///< of the functional
  VectorXd gradient;     ///< by the parameters' coordinates
  double predicted = 0;  ///< λᵀr: how far the functional is off, to first order
  long iterations = 0, factorisations = 0;
};

class Sweep {
 public:
  explicit Sweep(const SceneModel& scene_model)
      : scene_model_(scene_model),
        output_(adjoint::default_output(scene_model.model())),
        columns_(parameter_columns(scene_model, 1000)) {}

  /// Nothing when stopped. Throws adjoint::GradientError.
  std::optional<Measured> run(const MinimiserOptions& minimiser, const Progress& progress) const {
    RunOptions options = scene_model_.run_options();
    options.minimiser = minimiser;
    RunObserver observer;
    observer.iteration = [&](int, double, int, double, double) { return !progress.interrupted(); };
    const Model& model = scene_model_.model();
    const VectorXd native = scene_model_.native();
    Measured m;
    m.run = simulate(model, native, options, observer);
    if (progress.interrupted()) return std::nullopt;
    if (!m.run.complete)
      throw adjoint::GradientError("the run did not reach its last frame: " + m.run.failure);
    const std::vector<VectorXd> weights = adjoint::random_weights(*output_, m.run.frames(), 1),
                                values = adjoint::output_values(model, native, m.run, *output_);
    for (std::size_t f = 0; f < values.size(); ++f) m.value += weights[f].dot(values[f]);
    const adjoint::AdjointResult result = adjoint::adjoint_sweep(model, native, m.run, *output_, weights);
    m.gradient = columns_.transpose() * result.native_bar;
    m.predicted = result.residual_error;
    for (const StepRecord& record : m.run.steps) {
      m.iterations += record.report.iterations;
      m.factorisations += record.report.factorisations;
    }
    return m;
  }

 private:
  const SceneModel& scene_model_;
  std::shared_ptr<const adjoint::Output> output_;
  MatrixXd columns_;
};

class ToleranceBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "tolerance", "error of positions, of a functional and of its gradient against the solver's tolerance",
        "Simulates a drag over a patch of skin, or FILE, to looser and tighter tolerances and compares with "
        "a polished run: largest error of a position, error of a functional beside the estimate that the "
        "adjoint gives of it without that run (sum of adjoint times residual), and error of the gradient by "
        "all parameters. Writes tolerance.csv and tolerance.md into -o DIR."};
  }
  void add_options(CLI::App& app) override {
    scenes_.add_options(app);
    app.add_option("--tolerances", tolerances_, "relative tolerances (default 1e-1,1e-2,...,1e-10)")
        ->delimiter(',')
        ->option_text("T,...")
        ->check(CLI::Range(1e-14, 1.));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    CsvTable csv({{"scene", ""},
                  {"nodes", ""},
                  {"relative_tolerance", ""},
                  {"iterations", ""},
                  {"factorisations", ""},
                  {"time", "s"},
                  {"largest_position_error", "mm"},
                  {"functional_error", ""},
                  {"predicted_functional_error", ""},
                  {"gradient_error", ""}});
    std::string markdown =
        "| scene | tolerance | iterations | s | position error, mm | functional error | predicted | gradient "
        "error |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n";
    for (const BenchScene& one : scenes_.load(context, folder)) {
      const SceneModel scene_model(one.scene);
      const Sweep sweep(scene_model);
      context.progress.stage(one.name, static_cast<int>(tolerances_.size()) + 1);
      // Relative tolerances alone: an absolute one would act in their place where they are small.
      MinimiserOptions tight = adjoint::certificate_minimiser(scene_model.run_options().minimiser);
      tight.relative_tolerance = 1e-12;
      tight.absolute_tolerance = 0;
      const std::optional<Measured> reference = sweep.run(tight, context.progress);
      int done = 0;
      for (const double tolerance : tolerances_) {
        if (!reference) return ExitCode::interrupted;
        context.progress.step_done(++done);
        MinimiserOptions loose = scene_model.run_options().minimiser;
        loose.relative_tolerance = tolerance;
        loose.absolute_tolerance = 0;
        loose.polish = false;
        const std::optional<Measured> m = sweep.run(loose, context.progress);
        if (!m) return ExitCode::interrupted;
        double position = 0;
        if (m->run.steps.size() != reference->run.steps.size())
          throw adjoint::GradientError(
              "a run was bisected, so runs of different tolerances have other steps");
        for (std::size_t i = 0; i < m->run.steps.size(); ++i)
          position =
              std::max(position,
                       (m->run.steps[i].state.u - reference->run.steps[i].state.u).lpNorm<Eigen::Infinity>());
        const double functional = m->value - reference->value,
                     gradient = (m->gradient - reference->gradient).norm() / reference->gradient.norm();
        csv.add_row({one.name, std::int64_t{scene_model.model().num_nodes()}, tolerance,
                     std::int64_t{m->iterations}, std::int64_t{m->factorisations}, m->run.seconds, position,
                     functional, m->predicted, gradient});
        char row[200];
        std::snprintf(row, sizeof row, " | %.0e | %ld | %.3g | %.1e | %.2e | %.2e | %.1e |\n", tolerance,
                      m->iterations, m->run.seconds, position, functional, m->predicted, gradient);
        markdown += "| " + one.name + row;
        csv.write(folder + "/tolerance.csv");
        write_file(folder + "/tolerance.md", markdown);
      }
      context.progress.finish();
    }
    context.out << markdown << folder << "/tolerance.csv\n";
    return ExitCode::ok;
  }

 private:
  BenchSceneOptions scenes_{20};
  std::vector<double> tolerances_ = {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10};
};

}  // namespace

std::unique_ptr<Benchmark> make_tolerance_benchmark() {
  return std::make_unique<ToleranceBenchmark>();
}

}  // namespace rhytid::tools
