// rhytid schema: the formats of files, for editors and for people.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <ostream>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "tools/step_table.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

class Schema : public Verb {
 public:
  VerbHelp help() const override {
    return {"schema",
            "print the format of scenes, cases, experiments or steps.csv as JSON Schema or documentation",
            "Prints the format of scene files, of experiments ('schema experiment'), of case files ('schema "
            "case', in the program that fits), or "
            "of the "
            "table that simulate writes ('schema steps'). "
            "Validation, this schema and the documentation come from the same table of rules, so they agree. "
            "Give "
            "the schema to an editor for completion and checks while typing.",
            "nothing",
            "JSON Schema (draft 2020-12) on stdout; Markdown with --docs",
            "rhytid schema --docs"};
  }
  bool takes_file() const override { return false; }
  void add_options(CLI::App& app) override {
    app.add_option("format", format_,
                   "scene (default), experiment, case, or steps: the columns of steps.csv (always Markdown)")
        ->option_text("FORMAT");
    app.add_flag("--docs", as_documentation_, "the format as Markdown: every key, unit, range and default");
  }

  ExitCode run(VerbContext& context) override {
    std::vector<FileFormat> formats = {{"scene", scene_schema, scene_documentation}};
    formats.insert(formats.end(), context.program.formats.begin(), context.program.formats.end());
    formats.push_back({"steps", {}, step_table_documentation});
    const auto chosen = std::find_if(formats.begin(), formats.end(),
                                     [this](const FileFormat& f) { return f.name == format_; });
    if (chosen == formats.end()) {
      std::string names;
      for (const FileFormat& f : formats) names += (names.empty() ? "" : ", ") + f.name;
      throw InputError("schema", "'" + format_ + "'", "one of " + names);
    }
    if (as_documentation_ || !chosen->json_schema) {
      context.out << chosen->documentation();
    } else {
      context.out << chosen->json_schema().dump(2) << '\n';
    }
    return ExitCode::ok;
  }

 private:
  std::string format_ = "scene";
  bool as_documentation_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_schema() {
  return std::make_unique<Schema>();
}

}  // namespace rhytid::tools
