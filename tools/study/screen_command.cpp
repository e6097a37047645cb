// rhytid study screen: which parameters matter over their whole range.
#include <CLI/CLI.hpp>

#include "tools/study/screen.h"
#include "tools/study/study_command.h"

namespace rhytid::tools {
namespace {

class ScreenCommand final : public StudyCommand {
 public:
  StudyHelp help() const override {
    return {
        "screen",
        "which parameters matter over their whole range (Morris, Sobol)",
        "Runs the scene at many points of its parameters' ranges and ranks the parameters for each output at "
        "the last frame: force on every collider, rms and largest displacement of the outer surface, "
        "and with an experiment the amplitude of its wrinkles. By default Morris's elementary effects, "
        "trajectories x (parameters + 1) runs; with --sobol N first-order and total Sobol indices, N x "
        "(parameters + 2) runs. Every run is kept: the same command goes on after a stop, and --shard I/N "
        "does part of it into the same folder, and a last call without it makes the tables. Seeded: the same "
        "command makes the same runs.",
        "a scene, a case for its scene, or experiment.json for one of its variants; ranges (address, lower, "
        "upper)",
        "runs.csv, effects.csv (or indices.csv), OUTPUT.svg (mu* against sigma), OUTPUT_ranking.svg, "
        "screen.txt, index.html, a folder per run in runs. Prints the tables",
        "rhytid study screen data/scenes/sheet_drag/scene.json -o run/screen --trajectories 4 "
        "--parameter /ligaments/stiffness --parameter /skin/layers/film/youngs_modulus"};
  }

 protected:
  std::string file_help() const override { return "a scene, a case, or experiment.json"; }
  void add_options(CLI::App& app) override {
    auto* parameters =
        app.add_option("--parameter", options_.addresses,
                       "screen this address, as /ligaments/stiffness; repeatable (default: all but places)")
            ->allow_extra_args(false)
            ->option_text("ADDRESS");
    app.add_option("--bounds", options_.ranges, "table address,lower,upper: screens its parameters")
        ->excludes(parameters)
        ->option_text("TABLE");
    app.add_option(
           "--factor", options_.factor,
           "ranges are the scene's values divided and multiplied by this (default 2; odds of fractions; "
           "places move by 1 - 1/F of what a fit may move them, 2.5 mm for knots of a path, 5 mm for "
           "sources)")
        ->option_text("F");
    app.add_option("--trajectories", options_.trajectories, "of Morris (default 10)")
        ->check(CLI::Range(1, 100000))
        ->option_text("R");
    app.add_option("--levels", options_.levels, "of Morris, an even number (default 4)")
        ->check(CLI::IsMember({2, 4, 6, 8, 10, 12, 16, 20}))
        ->option_text("P");
    app.add_option("--sobol", options_.sobol_samples, "Sobol indices from so many samples instead")
        ->check(CLI::Range(2, 10000000))
        ->option_text("N");
    app.add_option("--seed", options_.seed, "of the design (default 1)")->option_text("SEED");
    app.add_option("--variant", options_.variant, "of an experiment (default: the first)")
        ->option_text("NAME");
    app.add_option("--shard", shard_, "run part I of N only")->option_text("I/N");
    app.add_flag("--anew", options_.anew, "run again what is finished");
  }

  std::string variant() const override { return options_.variant; }

  ExitCode study(VerbContext& context) override {
    options_.size = size();
    options_.shard = parse_shard(shard_);
    return run_screen(context, options_);
  }

 private:
  ScreenOptions options_;
  std::string shard_;
};

}  // namespace

std::unique_ptr<StudyCommand> make_study_screen() {
  return std::make_unique<ScreenCommand>();
}

}  // namespace rhytid::tools
