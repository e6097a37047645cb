// rhytid fit: tracks to parameters with intervals.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <ostream>

#include "fitting/case.h"
#include "fitting/fit.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
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
        "section 'fit' of the case.",
        "case.json, its scene; tracks.csv and camera.yaml from the case or the -o folder; truth.json of the "
        "-o folder if there is one",
        "fit.json, residuals.csv, answer.txt, report.html, and the table of answer.txt on stdout",
        "rhytid fit data/scenes/demo/case.json -o run/demo"};
  }
  void add_options(CLI::App& app) override {
    app.add_option("--optimiser", optimiser_, "ceres or nlopt instead of what the case says")
        ->check(CLI::IsMember({"ceres", "nlopt"}));
    app.add_option(
           "--parameters", addresses_,
           "fit these addresses instead of those of the case (which still lend bounds and starts), as "
           "--parameters /ligaments/stiffness,/base/stiffness")
        ->delimiter(',');
    app.add_option("--max-evaluations", max_evaluations_, "forward runs at most")
        ->check(CLI::Range(1, 100000));
  }

  ExitCode run(VerbContext& context) override {
    const fitting::Case c = fitting::load_case(context.options.file, context.options.settings);
    const std::string folder = context.output_folder();
    const std::string tracks = fitting::tracks_path(c, folder), camera = fitting::camera_path(c, folder);
    fitting::FitInput input{.scene = load_scene(c.scene, c.scene_settings),
                            .camera = fitting::read_camera(camera),
                            .tracks = fitting::read_tracks(tracks),
                            .options = options_of(c),
                            .truth = {}};
    adopt_camera_name(input, context);
    const std::string truth = (fs::path(folder) / "truth.json").string();
    if (fs::exists(truth)) input.truth = fitting::read_truth(truth, input.scene);

    fitting::FitResult result = fitting::run_fit(input, observer(context, input.options));
    result.case_name = c.name;
    result.case_file = c.file;
    result.scene_file = c.scene;
    result.footage_file = fitting::footage_path(c, folder);
    result.tracks_file = tracks;
    result.camera_file = camera;
    fitting::write_fit_result(result, folder);
    const std::string answer = fitting::answer_text(result);
    write_file((fs::path(folder) / "answer.txt").string(), answer);
    context.progress.finish();
    context.out << answer << (fs::path(folder) / "fit.json").string() << std::endl;
    if (context.progress.interrupted()) return ExitCode::interrupted;
    const ReportOutcome report = write_report(folder, context.progress);
    for (const std::string& sentence : report.left_out) context.progress.warning(sentence);
    context.progress.finish();
    context.out << report.path << '\n';
    if (report.interrupted) return ExitCode::interrupted;
    return result.converged ? ExitCode::ok : ExitCode::not_converged;
  }

 private:
  fitting::FitCase options_of(const fitting::Case& c) const {
    fitting::FitCase options = c.fit;
    if (!optimiser_.empty()) options.optimiser = optimiser_;
    if (max_evaluations_ > 0) options.max_evaluations = max_evaluations_;
    if (addresses_.empty()) return options;
    options.parameters.clear();
    for (const std::string& address : addresses_) {
      const auto known = std::find_if(c.fit.parameters.begin(), c.fit.parameters.end(),
                                      [&](const fitting::FitParameter& p) { return p.address == address; });
      fitting::FitParameter parameter;
      parameter.address = address;
      options.parameters.push_back(known == c.fit.parameters.end() ? parameter : *known);
    }
    return options;
  }

  /// Tracks name their camera, and so does a camera file; with one camera in play both mean the same.
  static void adopt_camera_name(fitting::FitInput& input, VerbContext& context) {
    if (input.tracks.tracks.empty()) return;
    const std::string& name = input.tracks.tracks.front().camera;
    const auto same = [&name](const fitting::Track& t) { return t.camera == name; };
    const bool is_only = std::all_of(input.tracks.tracks.begin(), input.tracks.tracks.end(), same);
    if (is_only && input.camera.name != name) {
      context.progress.note("all tracks are of camera '" + name + "'; the camera file's name '" +
                            input.camera.name + "' is ignored");
      input.camera.name = name;
    }
  }

  static fitting::FitObserver observer(VerbContext& context, const fitting::FitCase& options) {
    fitting::FitObserver o;
    Progress& progress = context.progress;
    o.should_stop = [&progress] { return progress.interrupted(); };
    o.registered = [&progress, options](const fitting::FitProblem& p) {
      const fitting::RegistrationReport& r = p.registration().report;
      progress.note(std::to_string(p.compared().size()) + " tracks on the skin, " +
                    std::to_string(r.left_out()) + " left out, " + std::to_string(p.num_observations()) +
                    " observations in " + std::to_string(p.frames()) + " frames");
      progress.stage("fit", options.max_evaluations);
    };
    o.run = [&progress](const fitting::FitProgress& p) {
      std::string values;
      for (const double v : p.values) values += " " + text_of("%.4g", v);
      progress.note("run " + std::to_string(p.forward_runs) + " (" + text_of("%.1f", p.seconds) + " s): " +
                    (p.failed ? "failed: " + p.failure : "cost " + text_of("%.6g", p.cost)) + " at" + values);
      progress.step_done(p.forward_runs);
    };
    return o;
  }

  std::string optimiser_;
  std::vector<std::string> addresses_;
  int max_evaluations_ = 0;
};

}  // namespace

std::unique_ptr<Verb> make_verb_fit() {
  return std::make_unique<Fit>();
}

}  // namespace rhytid::tools
