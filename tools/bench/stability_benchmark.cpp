#include "tools/bench/stability_benchmark.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <map>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "tools/bench/stability_run.h"

namespace rhytid::tools {
namespace {

std::string number(double value, const char* pattern = "%.2g") {
  char text[32];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

/// A cell of a Markdown table: one line, not too long (the CSV has all), no bars.
std::string cell(std::string text) {
  constexpr std::size_t longest = 140;
  text = one_line(text);
  if (text.size() > longest) text.replace(longest, std::string::npos, "...");
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.insert(at, "\\");
  return text;
}

class Tables {
 public:
  Tables()
      : csv_({{"sweep", ""},
              {"value", ""},
              {"outcome", ""},
              {"as_demanded", ""},
              {"frames", ""},
              {"steps", ""},
              {"bisections", ""},
              {"softened", ""},
              {"iterations", ""},
              {"min_J", ""},
              {"residual_over_tolerance", ""},
              {"largest_displacement", "mm"},
              {"time", "s"},
              {"message", ""},
              {"settings", ""}}) {}

  void add(const StabilityCase& one, const StabilityResult& r) {
    std::string settings;
    for (const std::string& s : one.settings)
      settings += (settings.empty() ? "--set '" : " --set '") + s + "'";
    csv_.add_row({one.sweep, one.value, std::string(name(r.outcome)), std::int64_t{r.as_demanded},
                  std::int64_t{r.frames}, std::int64_t{r.steps}, std::int64_t{r.bisections},
                  std::int64_t{r.softened}, std::int64_t{r.iterations}, r.smallest_jacobian, r.residual,
                  r.largest_displacement, r.seconds, r.message, settings});
    markdown_ += "| " + cell(one.sweep) + " | " + cell(one.value) + " | " + (r.as_demanded ? "" : "**") +
                 name(r.outcome) + (r.as_demanded ? "" : "**") + " | " + std::to_string(r.steps) + " | " +
                 std::to_string(r.bisections) + " | " + std::to_string(r.softened) + " | " +
                 std::to_string(r.iterations) + " | " + number(r.smallest_jacobian, "%.3g") + " | " +
                 number(r.residual) + " | " + number(r.seconds) + " | " + cell(r.message) + " |\n";
  }

  void write(const std::string& folder) const {
    csv_.write(folder + "/stability.csv");
    write_file(folder + "/stability.md",
               "# Stability\n\n`base.json` with one setting taken to its extreme (settings in "
               "`stability.csv`). Bold: not what "
               "must come out.\nResidual: the largest of all steps over the tolerance it must meet. "
               "Bisections: the deepest. "
               "Softened: steps whose\nstart came from a softened penalty.\n\n"
               "| sweep | value | outcome | steps | bisections | softened | iterations | min J | residual | "
               "time, s | "
               "message |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n" +
                   markdown_);
  }

 private:
  CsvTable csv_;
  std::string markdown_;
};

class StabilityBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "stability", "every setting at its extremes: converged or clearly refused",
        "Takes one setting at a time to its extremes on a small scene that has every feature, and says of "
        "each "
        "case whether it converged, was refused or did not converge, with iterations, bisections, smallest J "
        "and "
        "the residual reached. Every state is checked anew. Exit 3 when a case does not come out as it must. "
        "Writes stability.csv, stability.md and base.json into -o DIR; the settings in the table repeat a "
        "case: "
        "rhytid simulate base.json --set ..."};
  }
  void add_options(CLI::App& app) override {
    app.add_flag("--quick", quick_, "only the subset that the tests run");
    app.add_option("--only", only_, "only sweeps whose name contains TEXT")->option_text("TEXT");
    app.add_option("--limit", limit_, "seconds that a case may take")
        ->option_text("S")
        ->check(CLI::Range(0.1, 3600.));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    std::vector<const StabilityCase*> chosen;
    for (const StabilityCase& one : stability_cases())
      if ((!quick_ || one.is_quick) && one.sweep.find(only_) != std::string::npos) chosen.push_back(&one);
    if (chosen.empty()) throw InputError("--only", "'" + only_ + "'", "a part of a sweep's name");
    write_file(folder + "/base.json", stability_scene());
    context.progress.stage("stability", static_cast<int>(chosen.size()));
    Tables tables;
    std::map<std::string, int> outcomes;
    int wrong = 0;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      StabilityResult result =
          run_stability_case(*chosen[k], limit_, [&] { return context.progress.interrupted(); });
      if (context.progress.interrupted()) return ExitCode::interrupted;
      if (result.outcome == StabilityOutcome::converged) {
        const std::string warnings = stability_warnings(*chosen[k]);
        if (!warnings.empty()) result.message = "warns: " + warnings;
      }
      tables.add(*chosen[k], result);
      tables.write(folder);
      ++outcomes[name(result.outcome)];
      if (!result.as_demanded) {
        ++wrong;
        context.progress.warning(chosen[k]->sweep + " " + chosen[k]->value + ": " + name(result.outcome) +
                                 ", " + result.message);
      }
      context.progress.step_done(static_cast<int>(k + 1));
    }
    context.progress.finish();
    for (const auto& [outcome, count] : outcomes) context.out << outcome << " " << count << ", ";
    context.out << (wrong ? std::to_string(wrong) + " not as they must" : std::string("all as they must"))
                << "; " << folder << "/stability.md\n";
    return wrong ? ExitCode::not_converged : ExitCode::ok;
  }

 private:
  bool quick_ = false;
  std::string only_;
  double limit_ = 60;
};

}  // namespace

std::unique_ptr<Benchmark> make_stability_benchmark() {
  return std::make_unique<StabilityBenchmark>();
}

}  // namespace rhytid::tools
