#include "tools/study/study_command.h"

#include <CLI/CLI.hpp>

namespace rhytid::tools {
namespace {

const std::string kSweep = "sweep";

}  // namespace

void StudyCommand::add_to(CLI::App& study) {
  const StudyHelp text = help();
  app_ = study.add_subcommand(text.name, text.summary);
  app_->fallthrough();
  app_->footer(text.description + "\n\nReads    " + text.reads + "\nWrites   " + text.writes + "\nExample  " +
               text.example);
  app_->add_option("file", file_, file_help())->required()->option_text("FILE");
  app_->add_option(
          "-o,--output", output_,
          "folder for results (default run/<name of the file, or of its folder when it is called scene, "
          "case, experiment or pareto>" +
              (is_of_experiments() ? "_<size>" + (text.name == kSweep ? "" : "_" + text.name)
                                   : "[_<variant>][_full]_" + text.name) +
              ")")
      ->option_text("DIR");
  app_->add_option("--set", settings_, "change one value of the scene; repeatable")
      ->allow_extra_args(false)
      ->option_text("/POINTER=VALUE");
  app_->add_option("--size", size_, "of an experiment: quick (default) or full")
      ->check(CLI::IsMember({"quick", "full"}))
      ->option_text("SIZE");
  add_options(*app_);
}

std::string StudyCommand::default_folder() const {
  const std::string study = help().name;
  std::string folder = default_output(file_);
  if (is_of_experiments()) return folder + "_" + name(size()) + (study == kSweep ? "" : "_" + study);
  if (!variant().empty()) folder += "_" + variant();
  if (size() == StudySize::full) folder += "_full";
  return folder + "_" + study;
}

bool StudyCommand::is_chosen() const {
  return app_ != nullptr && app_->parsed();
}

ExitCode StudyCommand::run(VerbContext& context) {
  for (const std::string& text : settings_) check_setting(text);
  CommonOptions own = context.options;
  own.file = file_;
  own.settings = settings_;
  own.output = output_.empty() ? default_folder() : output_;
  VerbContext inner{own, context.program, context.progress, context.out};
  return study(inner);
}

}  // namespace rhytid::tools
