// rhytid schema: the scene format, for editors and for people.
#include <CLI/CLI.hpp>
#include <ostream>

#include "sim/scene/load.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Schema : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "schema",
        "print the scene format as JSON Schema, or as documentation",
        "Prints the format of scene files. Validation, this schema and the documentation come from the same "
        "table of rules, so they agree. Give the schema to an editor for completion and checks while typing.",
        "nothing",
        "JSON Schema (draft 2020-12) on stdout; Markdown with --docs",
        "rhytid schema > scene.schema.json"};
  }
  bool takes_file() const override { return false; }
  void add_options(CLI::App& app) override {
    app.add_flag("--docs", as_documentation_, "the format as Markdown: every key, unit, range and default");
  }

  ExitCode run(VerbContext& context) override {
    if (as_documentation_) {
      context.out << scene_documentation();
    } else {
      context.out << scene_schema().dump(2) << '\n';
    }
    return ExitCode::ok;
  }

 private:
  bool as_documentation_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_schema() {
  return std::make_unique<Schema>();
}

}  // namespace rhytid::tools
