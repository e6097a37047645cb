#include "tools/study/study_command.h"

#include <CLI/CLI.hpp>
#include <filesystem>

namespace rhytid::tools {

void StudyCommand::add_to(CLI::App& study) {
  const StudyHelp text = help();
  app_ = study.add_subcommand(text.name, text.summary);
  app_->fallthrough();
  app_->footer(text.description + "\n\nReads    " + text.reads + "\nWrites   " + text.writes + "\nExample  " +
               text.example);
  app_->add_option("file", file_, file_help())->required()->option_text("FILE");
  app_->add_option("-o,--output", output_,
                   is_of_experiments()
                       ? "folder for results (default run/<name of the experiment>_<size>)"
                       : "folder for results (default run/<name of the scene>_" + text.name + ")")
      ->option_text("DIR");
  app_->add_option("--set", settings_, "change one value of the scene; repeatable")
      ->allow_extra_args(false)
      ->option_text("/POINTER=VALUE");
  app_->add_option("--size", size_, "of an experiment: quick (default) or full")
      ->check(CLI::IsMember({"quick", "full"}))
      ->option_text("SIZE");
  add_options(*app_);
}

bool StudyCommand::is_chosen() const {
  return app_ != nullptr && app_->parsed();
}

ExitCode StudyCommand::run(VerbContext& context) {
  for (const std::string& text : settings_) check_setting(text);
  CommonOptions own = context.options;
  own.file = file_;
  own.settings = settings_;
  const std::filesystem::path place = std::filesystem::absolute(file_).lexically_normal().parent_path();
  own.output = !output_.empty()      ? output_
               : is_of_experiments() ? "run/" + place.filename().string() + "_" + name(size())
                                     : default_output(file_) + "_" + help().name;
  VerbContext inner{own, context.program, context.progress, context.out};
  return study(inner);
}

}  // namespace rhytid::tools
