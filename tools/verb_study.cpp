// rhytid study: many runs of a scene side by side, and what its parameters do.
#include <CLI/CLI.hpp>

#include "sim/core/error.h"
#include "tools/study/study_command.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Study : public Verb {
 public:
  Study() {
    commands_.push_back(make_study_sweep());
    commands_.push_back(make_study_sensitivity());
    commands_.push_back(make_study_screen());
    commands_.push_back(make_study_plan());
  }

  VerbHelp help() const override {
    return {
        "study",
        "many runs of a scene side by side; what its parameters do; what to film next",
        "`sweep` runs every variant of an experiment.json (a scene and lists of settings), or every row of a "
        "grid or a table of parameters, and measures crests, wavelength, amplitude and extent of the "
        "wrinkles "
        "after every frame. `sensitivity` differentiates one run: how far each parameter moves the surface, "
        "which combinations positions cannot tell, where on the face ligaments matter. `screen` ranks "
        "parameters over their whole range by Morris's elementary effects or Sobol indices. `plan` predicts "
        "what planned swipes would tell and which to film next. What is finished is kept while settings, "
        "files "
        "and program are the same: the same command after a stop, or a kill, goes on where it was. `rhytid "
        "study NAME --help` has the options of each.",
        "a scene, or experiment.json and the scene it names",
        "tables (CSV), plots (SVG), pictures and index.html; `sweep` also a folder per variant with "
        "the files of `simulate`, wrinkles.csv, profile.csv, above.png and, with ligaments, ligaments.png",
        "rhytid study sweep data/scenes/layer_ratio/experiment.json -o run/layer_ratio"};
  }
  bool takes_file() const override { return false; }

  void add_options(CLI::App& app) override {
    app.require_subcommand(1);
    app.fallthrough();
    for (const auto& command : commands_) command->add_to(app);
  }

  ExitCode run(VerbContext& context) override {
    for (const auto& command : commands_)
      if (command->is_chosen()) return command->run(context);
    throw ContractError("study: a parsed command is not in the list");
  }

 private:
  std::vector<std::unique_ptr<StudyCommand>> commands_;
};

}  // namespace

std::unique_ptr<Verb> make_verb_study() {
  return std::make_unique<Study>();
}

}  // namespace rhytid::tools
