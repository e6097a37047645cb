// A study of the command line: `rhytid study NAME FILE ...`. One file per study, NAME_command.cpp, defines
// make_study_NAME(); verb_study.cpp lists it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tools/study/experiment.h"
#include "tools/verb.h"

namespace rhytid::tools {

/// What `rhytid study NAME --help` says besides the options.
struct StudyHelp {
  std::string name, summary;
  std::string description;  ///< a paragraph
  std::string reads, writes, example;
};

class StudyCommand {
 public:
  virtual ~StudyCommand() = default;
  virtual StudyHelp help() const = 0;
  /// Adds the study to `study` with the options that all have (FILE, -o, --set, --size) and its own.
  void add_to(CLI::App& study);
  /// Whether the command line asked for it.
  bool is_chosen() const;
  /// Checks the common options and runs it.
  ExitCode run(VerbContext& context);

 protected:
  virtual void add_options(CLI::App& app) = 0;
  /// context.options carries file, output and settings of this study.
  virtual ExitCode study(VerbContext& context) = 0;
  /// FILE as --help describes it.
  virtual std::string file_help() const = 0;
  /// Whether it runs all variants of an experiment, each into a folder of its own; else one scene.
  virtual bool is_of_experiments() const { return false; }
  /// The variant asked for; empty = the first, or all.
  virtual std::string variant() const { return ""; }

  StudySize size() const { return size_ == "full" ? StudySize::full : StudySize::quick; }

 private:
  /// Where results go without -o: run/NAME_SIZE[_STUDY] of experiments (a sweep adds nothing), else
  /// run/NAME[_VARIANT][_full]_STUDY.
  std::string default_folder() const;

  CLI::App* app_ = nullptr;
  std::string file_, output_, size_ = "quick";
  std::vector<std::string> settings_;
};

std::unique_ptr<StudyCommand> make_study_sweep();
std::unique_ptr<StudyCommand> make_study_sensitivity();
std::unique_ptr<StudyCommand> make_study_screen();
std::unique_ptr<StudyCommand> make_study_plan();

}  // namespace rhytid::tools
