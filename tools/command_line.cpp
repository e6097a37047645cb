// The frame around all verbs: options, help, exit codes. Knows no verb by name.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <new>
#include <ostream>

#include "sim/core/build_info.h"
#include "sim/core/error.h"
#include "tools/interrupt.h"
#include "tools/threads.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

std::string version_text(const Program& program) {
  const BuildInfo info = build_info();
  return program.name + " " + info.version + " (" + info.build_type + ", " + info.compiler +
         (info.sanitizers.empty() ? "" : ", " + info.sanitizers) + ")";
}

std::string footer(const VerbHelp& help) {
  std::string text;
  if (!help.reads.empty()) text += "Reads    " + help.reads + "\n";
  if (!help.writes.empty()) text += "Writes   " + help.writes + "\n";
  if (!help.example.empty()) text += "Example  " + help.example + "\n";
  return text +
         "Exit     0 ok, 2 bad input, 3 did not converge or a check failed, 4 interrupted, 1 anything else";
}

void add_verb(CLI::App& app, Verb& verb, CommonOptions& options) {
  const VerbHelp help = verb.help();
  // The list of verbs shows the summary, the verb's own --help the paragraph: CLI11 has one text for both.
  CLI::App* sub = app.add_subcommand(help.name, help.summary);
  sub->footer(footer(help));
  if (verb.takes_file()) {
    sub->add_option("file", options.file,
                    verb.takes_case() ? "a case, as data/scenes/demo/case.json"
                                      : "a scene, or a case for the scene that it fits")
        ->required(!verb.file_is_optional())
        ->option_text("FILE");
    sub->add_option("-o,--output", options.output, "folder for results (default run/<name of the scene>)")
        ->option_text("DIR");
    sub->add_option("--set", options.settings,
                    verb.takes_case()
                        ? "change one value of the case, as --set /fit/max_evaluations=20, or of its "
                          "scene, as --set /settings/0=/time/frames=12; repeatable"
                        : "change one value of the scene, as --set /time/frames=12; repeatable")
        ->option_text("/POINTER=VALUE")
        ->allow_extra_args(false);
  }
  sub->add_option("--threads", options.threads, "number of threads (default: all cores)")
      ->option_text("N")
      ->check(CLI::Range(1, max_threads));
  sub->add_flag("--log-json", options.log_json, "progress as one JSON object per line on stderr");
  verb.add_options(*sub);
}

std::string verb_names(const Program& program) {
  std::string names;
  for (const auto& verb : program.verbs) names += (names.empty() ? "" : ", ") + verb->help().name;
  return names;
}

/// Refuses an unknown verb by name; CLI11 would only speak of unexpected arguments.
void require_known_verb(const Program& program, int argc, const char* const* argv) {
  const std::string expected = "one of " + verb_names(program) + " (see " + program.name + " --help)";
  if (argc < 2) throw InputError("verb", "nothing", expected);
  const std::string first = argv[1];
  if (!first.empty() && first[0] == '-') return;
  for (const auto& verb : program.verbs) {
    if (verb->help().name == first) return;
  }
  throw InputError("verb", "'" + first + "'", expected);
}

/// The folder and those around it that do not exist, innermost first.
std::vector<std::filesystem::path> missing_folders(const std::string& folder) {
  std::vector<std::filesystem::path> missing;
  std::error_code ignored;
  std::filesystem::path path = std::filesystem::absolute(folder, ignored).lexically_normal();
  for (; path.has_relative_path() && !std::filesystem::exists(path, ignored); path = path.parent_path())
    missing.push_back(path);
  return missing;
}

ExitCode parse_and_run(const Program& program, int argc, const char* const* argv, std::ostream& out,
                       std::ostream& err, bool& log_json) {
  for (int i = 1; i < argc; ++i) log_json = log_json || std::string(argv[i]) == "--log-json";
  require_known_verb(program, argc, argv);

  CLI::App app(program.description, program.name);
  app.set_version_flag("--version", version_text(program));
  app.require_subcommand(1);
  app.footer("Units are mm, N, MPa and s. Run '" + program.name +
             " VERB --help' for what a verb reads and writes.");
  CommonOptions options;
  options.threads = available_threads();
  for (const auto& verb : program.verbs) add_verb(app, *verb, options);

  // A verb's --help shows its paragraph instead of the summary.
  if (argc > 2) {
    for (const auto& verb : program.verbs) {
      const VerbHelp help = verb->help();
      if (help.name == argv[1]) app.get_subcommand(help.name)->description(help.description);
    }
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help_or_version) {
    app.exit(help_or_version, out, err);
    return ExitCode::ok;
  } catch (const CLI::ParseError& error) {
    throw InputError(std::string(error.what()) + " (see " + program.name + " " + argv[1] + " --help)");
  }

  for (const std::string& text : options.settings) check_setting(text);
  if (options.output.empty()) options.output = default_output(options.file);
  use_threads(options.threads);

  const std::string chosen = app.get_subcommands().front()->get_name();
  for (const auto& verb : program.verbs) {
    if (verb->help().name != chosen) continue;
    InterruptGuard guard;
    Progress progress(progress_style_for_stderr(options.log_json), err);
    VerbContext context{options, program, progress, out};
    const auto missing = missing_folders(options.output);
    try {
      return verb->run(context);
    } catch (const InputError&) {
      std::error_code ignored;  // a refused command leaves no empty folders; others are not removed
      for (const std::filesystem::path& folder : missing) std::filesystem::remove(folder, ignored);
      throw;
    }
  }
  throw ContractError("a parsed verb is not in the program");
}

}  // namespace

void check_setting(const std::string& text, const std::string& where) {
  if (text.empty() || text[0] != '/' || text.find('=') == std::string::npos) {
    throw InputError(where, "'" + text + "'", "/json/pointer=value");
  }
}

std::string name_of_file(const std::string& file) {
  const std::filesystem::path path(file);
  std::filesystem::path name = path.stem();
  if (name == "scene" || name == "case" || name == "experiment" || name == "pareto") {
    const auto parent = std::filesystem::absolute(path).lexically_normal().parent_path().filename();
    if (!parent.empty()) name = parent;
  }
  return name.string();
}

std::string default_output(const std::string& file) {
  return (std::filesystem::path("run") / name_of_file(file)).lexically_normal().string();
}

std::string VerbContext::output_folder() const {
  std::error_code error;
  std::filesystem::create_directories(options.output, error);
  if (error || !std::filesystem::is_directory(options.output)) {
    throw InputError("--output", "'" + options.output + "'" + (error ? " (" + error.message() + ")" : ""),
                     "a folder that can be written");
  }
  return options.output;
}

int run_program(const Program& program, int argc, const char* const* argv, std::ostream& out,
                std::ostream& err) {
  bool log_json = false;
  std::string message;
  ExitCode code = ExitCode::unexpected;
  try {
    code = parse_and_run(program, argc, argv, out, err, log_json);
    out.flush();
    if (out.good()) return static_cast<int>(code);
    code = ExitCode::unexpected;
    message = "standard output cannot be written";
  } catch (const InputError& error) {
    code = ExitCode::bad_input;
    message = error.what();
  } catch (const ContractError& error) {
    message = std::string("internal error, please report: ") + error.what();
  } catch (const std::bad_alloc&) {
    message = "out of memory";
  } catch (const std::exception& error) {
    message = std::string("unexpected: ") + error.what();
  }
  Progress(log_json ? ProgressStyle::json_lines : ProgressStyle::plain_lines, err).error(message);
  return static_cast<int>(code);
}

}  // namespace rhytid::tools
