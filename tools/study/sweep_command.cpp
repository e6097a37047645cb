// rhytid study sweep: every variant of an experiment, or of a scene every set of a grid or a table.
#include <CLI/CLI.hpp>

#include "tools/study/parameter_sets.h"
#include "tools/study/study_command.h"
#include "tools/study/study_run.h"
#include "tools/study/sweep.h"

namespace rhytid::tools {
namespace {

class SweepCommand final : public StudyCommand {
 public:
  StudyHelp help() const override {
    return {
        "sweep",
        "run every variant of an experiment, or every row of a grid or a table of parameters",
        "Runs an experiment's variants one after the other and measures their wrinkles after every frame. "
        "With --grid or --csv each variant, or the scene itself, is run with every set of values. The same "
        "command goes on after a stop; with --shard I/N each of N machines runs its part into the same "
        "folder and makes no tables: a last call without it makes those of all. Tables of a sweep that goes "
        "on are made now and then, and at its end.",
        "experiment.json and its scene, or with --grid or --csv a scene; the table of --csv has addresses "
        "for columns (and maybe name) and a row per run",
        "results.csv, results.md, index.html and a folder per run with the files of `simulate`",
        "rhytid study sweep data/scenes/sheet_drag/scene.json -o run/grid --set /output/pictures=false "
        "--grid /ligaments/stiffness=\"0.2 kPa,0.5 kPa\" --grid /skin/order=2,3"};
  }
  bool is_of_experiments() const override { return true; }

 protected:
  std::string file_help() const override { return "experiment.json; a scene with --grid or --csv"; }
  void add_options(CLI::App& app) override {
    app.add_option("--only", options_.only, "run this variant only; repeatable")
        ->allow_extra_args(false)
        ->option_text("NAME");
    app.add_flag("--anew", options_.anew, "run from the beginning what is finished or begun");
    auto* grid = app.add_option("--grid", grid_, "run all combinations of these values; repeatable")
                     ->allow_extra_args(false)
                     ->option_text("ADDRESS=A,B,...");
    app.add_option("--csv", csv_, "run every row of this table")->option_text("TABLE")->excludes(grid);
    app.add_option("--shard", shard_, "run part I of N only")->option_text("I/N");
  }

  ExitCode study(VerbContext& context) override {
    options_.shard = parse_shard(shard_);
    const std::string& file = context.options.file;
    const bool has_sets = !grid_.empty() || !csv_.empty();
    if (!has_sets)
      return run_sweep(context, load_experiment(file, size(), ", or a scene with --grid or --csv"), options_);
    const std::vector<ParameterSet> sets = csv_.empty() ? grid_sets(grid_) : table_sets(csv_);
    const bool has_variants = is_experiment(file);
    if (!has_variants) refuse_case(file);
    const Experiment base = has_variants ? load_experiment(file, size()) : experiment_of_scene(file);
    return run_sweep(context, with_parameter_sets(base, sets), options_);
  }

 private:
  SweepOptions options_;
  std::vector<std::string> grid_;
  std::string csv_, shard_;
};

}  // namespace

std::unique_ptr<StudyCommand> make_study_sweep() {
  return std::make_unique<SweepCommand>();
}

}  // namespace rhytid::tools
