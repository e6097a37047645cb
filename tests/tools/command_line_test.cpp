// The frame around the verbs: outcomes become exit codes and at most one line on stderr.
#include <gmock/gmock.h>
#include <signal.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <functional>
#include <new>
#include <sstream>

#include "sim/core/error.h"
#include "tests/tools/program_call.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

/// A verb whose work is a lambda.
class Probe : public Verb {
 public:
  using Work = std::function<ExitCode(VerbContext&)>;
  explicit Probe(Work work) : work_(std::move(work)) {}
  VerbHelp help() const override {
    return {"probe", "summary text", "description text", "a scene", "nothing", "rhytid probe scene.json"};
  }
  void add_options(CLI::App& app) override { app.add_option("--depth", depth_); }
  ExitCode run(VerbContext& context) override { return work_(context); }

 private:
  Work work_;
  int depth_ = 0;
};

Outcome run(
    const std::vector<std::string>& arguments, Probe::Work work = [](VerbContext&) { return ExitCode::ok; }) {
  return call_program(arguments, std::make_unique<Probe>(std::move(work)));
}

Outcome run_throwing(const std::function<void()>& thrower) {
  return run({"probe", "scene.json"}, [&](VerbContext&) {
    thrower();
    return ExitCode::ok;
  });
}

TEST(CommandLine, passes_common_options_to_the_verb) {
  CommonOptions seen;
  const Outcome outcome = run({"probe", "scenes/demo/case.json", "-o", "results", "--set", "/time/frames=12",
                               "--set", "/name=[\"a=b\", 2]", "--threads", "1", "--depth", "3"},
                              [&](VerbContext& context) {
                                seen = context.options;
                                context.out << "done\n";
                                return ExitCode::ok;
                              });
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.out, "done\n");
  EXPECT_THAT(outcome.err, IsEmpty());
  EXPECT_EQ(seen.file, "scenes/demo/case.json");
  EXPECT_EQ(seen.output, "results");
  EXPECT_EQ(seen.threads, 1);
  EXPECT_THAT(seen.settings, testing::ElementsAre("/time/frames=12", "/name=[\"a=b\", 2]"));
}

TEST(CommandLine, a_refused_command_leaves_no_empty_folders) {
  namespace fs = std::filesystem;
  const fs::path base = fs::path(testing::TempDir()) / "refused_command";
  fs::remove_all(base);
  const auto refuse = [](bool writes) {
    return [writes](VerbContext& context) -> ExitCode {
      const std::string folder = context.output_folder();
      if (writes) std::ofstream(folder + "/kept.txt") << "x";
      throw InputError("no");
    };
  };
  const std::string inner = (base / "a" / "b").string();
  EXPECT_EQ(run({"probe", "s.json", "-o", inner}, refuse(false)).code, 2);
  EXPECT_FALSE(fs::exists(base));
  fs::create_directories(base / "a");
  EXPECT_EQ(run({"probe", "s.json", "-o", inner}, refuse(false)).code, 2);
  EXPECT_TRUE(fs::exists(base / "a"));
  EXPECT_FALSE(fs::exists(inner));
  EXPECT_EQ(run({"probe", "s.json", "-o", inner}, refuse(true)).code, 2);
  EXPECT_TRUE(fs::exists(inner + "/kept.txt"));
  fs::remove_all(base);
}

TEST(CommandLine, set_does_not_swallow_the_file) {
  std::string file;
  const Outcome outcome = run({"probe", "--set", "/a=1", "scene.json"}, [&](VerbContext& context) {
    file = context.options.file;
    return ExitCode::ok;
  });
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(file, "scene.json");
}

TEST(CommandLine, verb_outcomes_become_exit_codes) {
  for (const ExitCode code : {ExitCode::ok, ExitCode::not_converged, ExitCode::interrupted}) {
    EXPECT_EQ(run({"probe", "s.json"}, [&](VerbContext&) { return code; }).code, static_cast<int>(code));
  }
}

TEST(CommandLine, exceptions_become_one_line) {
  const Outcome bad = run_throwing([] { throw InputError("scene.json:3", "-1", "a positive\nthickness"); });
  EXPECT_EQ(bad.code, 2);
  EXPECT_EQ(bad.err, "rhytid: error: scene.json:3: got -1, expected a positive thickness\n");
  const Outcome bug = run_throwing([] { throw ContractError("sizes differ"); });
  EXPECT_EQ(bug.code, 1);
  EXPECT_EQ(bug.err, "rhytid: error: internal error, please report: sizes differ\n");
  const Outcome memory = run_throwing([] { throw std::bad_alloc(); });
  EXPECT_EQ(memory.code, 1);
  EXPECT_EQ(memory.err, "rhytid: error: out of memory\n");
  const Outcome other = run_throwing([] { throw std::runtime_error("line 1\n  line 2\n"); });
  EXPECT_EQ(other.code, 1);
  EXPECT_EQ(std::count(other.err.begin(), other.err.end(), '\n'), 1);
}

TEST(CommandLine, exceptions_are_json_with_log_json) {
  const Outcome bad =
      run({"probe", "s.json", "--log-json"}, [](VerbContext&) -> ExitCode { throw InputError("got \"x\""); });
  EXPECT_EQ(bad.code, 2);
  EXPECT_EQ(bad.err, "{\"event\":\"error\",\"text\":\"got \\\"x\\\"\"}\n");
}

TEST(CommandLine, wrong_command_lines_exit_with_2_and_one_line) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"prob", "s.json"},
      {"probe"},
      {"probe", "a.json", "b.json"},
      {"probe", "s.json", "--no-such-option"},
      {"probe", "s.json", "--threads", "many"},
      {"probe", "s.json", "--threads", "0"},
      {"probe", "s.json", "--set", "frames=12"},
      {"probe", "s.json", "--set", "/time/frames"},
      {"probe", "s.json", "--depth", "deep"},
      {""},
  };
  for (const auto& arguments : wrong) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 2) << testing::PrintToString(arguments);
    EXPECT_THAT(outcome.err, StartsWith("rhytid: error: ")) << testing::PrintToString(arguments);
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_THAT(outcome.out, IsEmpty());
  }
}

TEST(CommandLine, help_of_a_verb_says_what_it_reads_and_writes) {
  const Outcome outcome = run({"probe", "--help"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, IsEmpty());
  EXPECT_THAT(outcome.out, HasSubstr("description text"));
  EXPECT_THAT(outcome.out, HasSubstr("Reads    a scene"));
  EXPECT_THAT(outcome.out, HasSubstr("rhytid probe scene.json"));
  EXPECT_THAT(run({"--help"}).out, HasSubstr("summary text"));
}

TEST(CommandLine, an_interrupt_raises_the_flag_and_nothing_else) {
  bool before = true, after = false;
  const Outcome outcome = run({"probe", "s.json"}, [&](VerbContext& context) {
    before = context.progress.interrupted();
    raise(SIGINT);
    after = context.progress.interrupted();
    return after ? ExitCode::interrupted : ExitCode::ok;
  });
  EXPECT_FALSE(before);
  EXPECT_TRUE(after);
  EXPECT_EQ(outcome.code, 4);
}

TEST(CommandLine, a_second_interrupt_ends_the_process) {
  EXPECT_EXIT(run({"probe", "s.json"},
                  [](VerbContext&) {
                    raise(SIGINT);
                    raise(SIGINT);
                    return ExitCode::ok;
                  }),
              testing::KilledBySignal(SIGINT), "");
}

TEST(CommandLine, output_folder_defaults_to_the_scene_and_must_be_a_folder) {
  EXPECT_EQ(default_output("data/scenes/demo/case.json"), "run/demo");
  EXPECT_EQ(default_output("data/scenes/viscous_drag/experiment.json"), "run/viscous_drag");
  EXPECT_EQ(default_output("data/scenes/viscous_drag/pareto.json"), "run/viscous_drag");
  EXPECT_EQ(default_output("data/sphere.json"), "run/sphere");
  EXPECT_THAT(default_output("scene.json"), StartsWith("run/"));
  const auto folder = std::filesystem::temp_directory_path() / ("rhytid_output_" + std::to_string(getpid()));
  const auto work = [](VerbContext& context) {
    context.output_folder();
    return ExitCode::ok;
  };
  EXPECT_EQ(run({"probe", "s.json", "-o", (folder / "deep").string()}, work).code, 0);
  EXPECT_TRUE(std::filesystem::is_directory(folder / "deep"));
  std::filesystem::remove_all(folder);
  const Outcome refused = run({"probe", "s.json", "-o", "/dev/null/x"}, work);
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("/dev/null/x"));
}

}  // namespace
}  // namespace rhytid::tools
