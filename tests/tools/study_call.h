// `rhytid study ...` called in the test's own process: arguments in, exit code and texts out.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/output/atomic_file.h"
#include "tests/support/small_scenes.h"
#include "tests/support/temporary_folder.h"
#include "tests/tools/program_call.h"
#include "tools/verb.h"

namespace rhytid::tools {

std::unique_ptr<Verb> make_verb_study();

/// Runs "rhytid study" with these arguments on one thread.
inline Outcome call_study(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "study");
  arguments.insert(arguments.end(), {"--threads", "1"});
  return call_program(arguments, make_verb_study());
}

/// A folder of its own for a test, with a small scene of two frames in it, gone afterwards.
class StudyPlace {
 public:
  StudyPlace() { write_file(at("scene.json"), test::drag_scene(2, 2)); }
  std::string at(const std::string& file) const { return folder_ / file; }
  bool has(const std::string& file) const { return std::filesystem::exists(at(file)); }
  std::string text(const std::string& file) const { return read_file(at(file)); }
  /// "sweep", FILE, -o FOLDER/out, a coarse mesh and these arguments.
  Outcome call(const std::string& study, const std::string& file,
               const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {study, at(file), "-o", at("out"), "--set", test::coarse()[0]};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return call_study(arguments);
  }

 private:
  test::TemporaryFolder folder_;
};

}  // namespace rhytid::tools
