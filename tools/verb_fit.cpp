// rhytid fit: tracks to parameters with intervals.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <ostream>
#include <utility>

#include "fitting/case.h"
#include "fitting/fit.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tools/fit_input.h"
#include "tools/report/write_report.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

std::string text_of(const char* pattern, double x) {
  char text[48];
  std::snprintf(text, sizeof(text), pattern, x);
  return text;
}

class Fit : public Verb {
 public:
  VerbHelp help() const override {
    return {
        "fit",
        "find the parameters of a scene from tracks of skin points",
        "Attaches every track to the skin where it is seen in frame 0, runs the scene again and again with "
        "better parameters until its points project onto the tracks, and says how far the footage "
        "determines each parameter. Parameters, bounds and the layer whose modulus is held come from the "
        "section 'fit' of the case. Without tracks it tracks the footage first. A fit that was interrupted "
        "or "
        "killed goes on after its last completed run when the same command is given again.",
        "case.json, its scene; tracks.csv (or footage) and camera.yaml from the case or the -o folder; "
        "truth.json of the -o folder if there is one. A case with clips fits them together; files of a clip "
        "are in a folder of its name",
        "fit.json, residuals.csv, fitted_scene.json (the scene at the fitted values), answer.txt, "
        "report.html, "
        "evaluations/ (what a rerun need not compute again), and the table of answer.txt on stdout",
        "rhytid fit data/scenes/demo/case.json -o run/demo"};
  }
  bool takes_case() const override { return true; }
  void add_options(CLI::App& app) override {
    app.add_option("--optimiser", optimiser_, "ceres or nlopt instead of what the case says")
        ->check(CLI::IsMember({"ceres", "nlopt"}));
    app.add_option(
           "--parameters", addresses_,
           "fit these addresses instead of those of the case (which still lend bounds and starts), as "
           "--parameters /ligaments/stiffness,/base/stiffness")
        ->delimiter(',');
    app.add_option("--max-evaluations", max_evaluations_, "forward runs at most, from each start")
        ->check(CLI::Range(1, 100000));
    app.add_option("--starts", starts_,
                   "so many starts, that of the case and seeded ones about it: all are compared by a run on "
                   "the early frames, the fit goes on from the best few (/fit/local_fits)")
        ->check(CLI::Range(1, 100000));
    app.add_option(
           "--profile", profiles_,
           "find the intervals of these fitted parameters (all: of all) also by holding each at values "
           "about its best one and fitting the others again")
        ->delimiter(',')
        ->allow_extra_args(false);
    app.add_flag("--anew", anew_, "compute everything again, whatever an earlier start of this fit left");
  }

  ExitCode run(VerbContext& context) override {
    Progress& progress = context.progress;
    const fitting::Case c = fitting::load_case(context.options.file, context.options.settings);
    const std::string folder = context.output_folder();
    ExitCode tracked = ExitCode::ok;
    std::optional<fitting::JointFitInput> found = fit_input(c, options_of(c), folder, context, tracked);
    if (!found) return tracked;
    fitting::JointFitInput& input = *found;
    input.anew = anew_;

    fitting::FitResult result = fitting::run_fit(input, observer(context, input.options));
    if (result.stopped) {
      progress.finish();
      progress.note("stopped after " + std::to_string(result.forward_runs) +
                    " forward runs. Results of an earlier fit in " + folder +
                    " are as they were; the same command without --anew goes on from here");
      return ExitCode::interrupted;
    }
    record_files(c, folder, result);
    result.settings = context.options.settings;
    if (!input.truth.empty())
      result.notes.push_back("The footage was rendered; seed of texture and noise " +
                             std::to_string(c.render.seed) + ".");
    fitting::write_fit_result(result, folder);
    const std::string answer = fitting::answer_text(result);
    write_file((fs::path(folder) / "answer.txt").string(), answer);
    progress.finish();
    context.out << answer << "written: " << (fs::path(folder) / "fit.json").string() << std::endl;
    if (progress.interrupted()) return ExitCode::interrupted;
    const ExitCode code = result.converged ? ExitCode::ok : ExitCode::not_converged;
    const ExitCode reported = report(folder, context);
    return code == ExitCode::ok || reported == ExitCode::interrupted ? reported : code;
  }

 private:
  /// A report that cannot be made leaves the fit what it is: finished and on disk.
  static ExitCode report(const std::string& folder, VerbContext& context) {
    try {
      const ReportOutcome report = write_report(folder, context.progress);
      for (const std::string& sentence : report.left_out) context.progress.warning(sentence);
      context.progress.finish();
      context.out << "report: " << report.path << '\n';
      return report.interrupted ? ExitCode::interrupted : ExitCode::ok;
    } catch (const std::exception& error) {
      context.progress.error(std::string("the fit is complete, but its report could not be written: ") +
                             error.what());
      return ExitCode::unexpected;
    }
  }

  fitting::FitCase options_of(const fitting::Case& c) const {
    fitting::FitCase options = c.fit;
    if (!optimiser_.empty()) options.optimiser = optimiser_;
    if (max_evaluations_ > 0) options.max_evaluations = max_evaluations_;
    if (starts_ > 0) options.starts = starts_;
    if (addresses_.empty() && profiles_.empty()) return options;
    const std::vector<Scene> scenes = fitting::scenes_of(c);
    if (!addresses_.empty()) choose_parameters(c, scenes, options);
    if (profiles_.empty()) return options;
    options.profiles.clear();
    for (const std::string& given : profiles_)
      for (const std::string& address :
           fitting::fitted_named(c, scenes, options.parameters, given, "--profile"))
        options.profiles.push_back(address);
    return options;
  }

  /// Those of --parameters, and of the profiles that the case asks for those that are left.
  void choose_parameters(const fitting::Case& c, const std::vector<Scene>& scenes,
                         fitting::FitCase& options) const {
    options.parameters.clear();
    for (const std::string& given : addresses_)
      for (const fitting::FitParameter& named : fitting::parameters_named(c, scenes, given, "--parameters")) {
        const auto known = std::find_if(c.fit.parameters.begin(), c.fit.parameters.end(),
                                        [&](const fitting::FitParameter& p) {
                                          return p.address == named.address && p.clip == named.clip;
                                        });
        options.parameters.push_back(known == c.fit.parameters.end() ? named : *known);
      }
    std::erase_if(options.profiles, [&](const std::string& address) {
      return address != "all" && std::none_of(options.parameters.begin(), options.parameters.end(),
                                              [&](const fitting::FitParameter& p) {
                                                return fitting::joint_address(p) == address;
                                              });
    });
  }

  static int most_runs(const fitting::FitCase& options) {
    if (!options.profiles.empty()) return 0;  // not known
    int before = 0;  // and one run at either end of the stages, to see which is better
    for (const fitting::StageCase& stage : options.stages) before += stage.max_evaluations;
    if (before > 0) before += 2;
    if (options.starts == 1) return before + options.max_evaluations;
    return before + options.starts + std::min(options.starts, options.local_fits) * options.max_evaluations;
  }

  static fitting::FitObserver observer(VerbContext& context, const fitting::FitCase& options) {
    fitting::FitObserver o;
    Progress& progress = context.progress;
    o.should_stop = [&progress] { return progress.interrupted(); };
    o.registered = [&progress, options, is_first = true](const fitting::FitProblem& p) mutable {
      const fitting::RegistrationReport& r = p.registration().report;
      progress.note((p.name.empty() ? "" : "clip " + p.name + ": ") + std::to_string(p.compared().size()) +
                    " tracks on the skin, " + std::to_string(r.left_out()) + " left out, " +
                    std::to_string(p.num_observations()) + " observations in " + std::to_string(p.frames()) +
                    " frames");
      if (std::exchange(is_first, false)) progress.stage("fit", most_runs(options));
    };
    o.note = [&progress](const std::string& text) { progress.note(text); };
    // Stages, starts and the fit count their own runs; here is how many there were in all.
    o.run = [&progress, count = std::make_shared<int>(0)](const fitting::FitProgress& p) {
      const int runs = ++*count;  // copies of this function count on
      std::string values;
      for (const double v : p.values) values += " " + text_of("%.4g", v);
      progress.note("run " + std::to_string(runs) + " (" + text_of("%.1f", p.seconds) +
                    (p.replayed ? " s then): " : " s): ") +
                    (p.failed ? "failed: " + p.failure : "cost " + text_of("%.6g", p.cost)) + " at" + values);
      progress.step_done(runs);
    };
    return o;
  }

  std::string optimiser_;
  std::vector<std::string> addresses_, profiles_;
  int max_evaluations_ = 0, starts_ = 0;
  bool anew_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_fit() {
  return std::make_unique<Fit>();
}

}  // namespace rhytid::tools
