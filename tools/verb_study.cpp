// rhytid study: many runs of a scene side by side.
#include <CLI/CLI.hpp>
#include <filesystem>

#include "sim/core/error.h"
#include "tools/study/sweep.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Study : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "study",
        "many runs of a scene side by side, with their wrinkles measured",
        "`sweep` runs every variant of an experiment.json (a scene and lists of settings) and measures "
        "crests, wavelength, amplitude and extent of the wrinkles after every frame. What is finished is "
        "kept while settings, files and program are the same: the same command after a stop, or a kill, goes "
        "on where it was.",
        "experiment.json, and the scene and mesh it names",
        "results.csv, results.md, index.html (table, profiles, pictures), and per variant a folder with "
        "the files of `simulate`, wrinkles.csv, profile.csv, above.png and, with ligaments, ligaments.png",
        "rhytid study sweep data/scenes/layer_ratio/experiment.json -o run/layer_ratio"};
  }
  bool takes_file() const override { return false; }

  void add_options(CLI::App& app) override {
    app.require_subcommand(1);
    app.fallthrough();
    CLI::App* sweep = app.add_subcommand("sweep", "run every variant of an experiment");
    sweep->fallthrough();
    sweep->add_option("file", file_, "experiment.json")->required()->option_text("FILE");
    sweep
        ->add_option("-o,--output", output_,
                     "folder for results (default run/<name of the experiment>_<size>)")
        ->option_text("DIR");
    sweep->add_option("--size", size_, "quick (default) or full")
        ->check(CLI::IsMember({"quick", "full"}))
        ->option_text("SIZE");
    sweep->add_option("--only", only_, "run this variant only; repeatable")
        ->allow_extra_args(false)
        ->option_text("NAME");
    sweep->add_flag("--anew", anew_, "run from the beginning what is finished or begun");
    sweep->add_option("--set", settings_, "change one value of the scene in all variants; repeatable")
        ->allow_extra_args(false)
        ->option_text("/POINTER=VALUE");
  }

  ExitCode run(VerbContext& context) override {
    for (const std::string& text : settings_) check_setting(text);
    const StudySize size = size_ == "full" ? StudySize::full : StudySize::quick;
    const Experiment experiment = load_experiment(file_, size);
    CommonOptions own = context.options;
    own.file = file_;
    own.settings = settings_;
    const std::filesystem::path place = std::filesystem::absolute(file_).lexically_normal().parent_path();
    own.output = output_.empty() ? "run/" + place.filename().string() + "_" + name(size) : output_;
    VerbContext inner{own, context.program, context.progress, context.out};
    SweepOptions options;
    options.only = only_;
    options.anew = anew_;
    return run_sweep(inner, experiment, options);
  }

 private:
  std::string file_, output_, size_ = "quick";
  std::vector<std::string> only_, settings_;
  bool anew_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_study() {
  return std::make_unique<Study>();
}

}  // namespace rhytid::tools
