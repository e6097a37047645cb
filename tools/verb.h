// What a verb of the command line is. One file per verb, verb_<name>.cpp, defines make_verb_<name>();
// tools/CMakeLists.txt lists it with rhytid_verb(<name>). See tools/README.md.
#pragma once

#include <functional>
#include <iosfwd>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/exit_code.h"
#include "tools/progress.h"

namespace CLI {
class App;
}

namespace rhytid::tools {

/// Throws InputError unless `text` reads /json/pointer=value, as --set wants it. `where` names the text.
void check_setting(const std::string& text, const std::string& where = "--set");

/// The options that all verbs share.
struct CommonOptions {
  std::string file;                   ///< scene or case as typed; empty when the verb takes none
  std::string output;                 ///< folder for results; given by -o, else run/<name of the scene>
  std::vector<std::string> settings;  ///< "/json/pointer=value" in the order given, as load_scene takes them
  int threads = 1;                    ///< already applied to OpenMP and BLAS
  bool log_json = false;
};

/// The stem of the file, or the name of its folder for scene.json, case.json and experiment.json.
std::string name_of_file(const std::string& file);

/// The default output folder: run/<name_of_file>.
std::string default_output(const std::string& file);

/// One line of doctor.
struct EnvironmentFact {
  enum class Verdict { fact, good, bad };
  std::string name, value;
  Verdict verdict = Verdict::fact;
};

/// A kind of file, for schema.
struct FileFormat {
  std::string name;                             ///< "case"
  std::function<nlohmann::json()> json_schema;  ///< draft 2020-12
  std::function<std::string()> documentation;   ///< Markdown
};

struct Program;

struct VerbContext {
  const CommonOptions& options;
  const Program& program;
  Progress& progress;  ///< on stderr; poll progress.interrupted()
  std::ostream& out;   ///< stdout: results a person or a script reads

  /// Creates options.output if need be and returns it. Throws InputError when it cannot be written.
  std::string output_folder() const;
};

struct VerbHelp {
  std::string name;
  std::string summary;      ///< a line for the list of verbs
  std::string description;  ///< a paragraph: what it does and when one wants it
  std::string reads;        ///< files it reads
  std::string writes;       ///< files it writes into -o, and what it prints
  std::string example;      ///< a command that works in a clean checkout
};

class Verb {
 public:
  virtual ~Verb() = default;
  virtual VerbHelp help() const = 0;
  /// Whether the scene/case file is required, with -o and --set; else none of the three is accepted.
  virtual bool takes_file() const { return true; }
  /// Whether the file may be left out all the same (options.file is then empty).
  virtual bool file_is_optional() const { return false; }
  /// Whether that file is a case; else it is a scene, or a case for its scene.
  virtual bool takes_case() const { return false; }
  /// Options of its own, bound to members.
  virtual void add_options(CLI::App&) {}
  /// Does the work. Throws InputError for bad input (exit 2); numerical outcomes are exit codes.
  virtual ExitCode run(VerbContext& context) = 0;
};

/// A program is a name and the verbs it carries.
struct Program {
  std::string name;
  std::string description;
  std::vector<std::unique_ptr<Verb>> verbs;
  /// What doctor reports beyond the simulator's own libraries.
  std::vector<std::function<std::vector<EnvironmentFact>()>> environment_checks;
  /// Formats that schema prints beside that of scenes.
  std::vector<FileFormat> formats = {};
};

/// Parses the command line, runs the verb, turns every outcome into an exit code and at most one line on
/// `err`.
int run_program(const Program& program, int argc, const char* const* argv, std::ostream& out,
                std::ostream& err);

}  // namespace rhytid::tools
