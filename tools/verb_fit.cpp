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
#include "sim/scene/parameter.h"
#include "tools/footage_record.h"
#include "tools/report/write_report.h"
#include "tools/track_footage.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

std::string text_of(const char* pattern, double x) {
  char text[48];
  std::snprintf(text, sizeof(text), pattern, x);
  return text;
}

/// Items of lists may be addressed by number or by name; the case's parameters are known by name.
std::string address_by_names(const Scene& scene, const std::string& given) {
  try {
    return describe_parameter(scene, given).address;
  } catch (const InputError& error) {
    throw InputError(std::string("--parameters: ") + error.what());
  }
}

/// How fit.json names a file, so that it is found again from any working directory: relative to the folder of
/// results when it lies in there (the folder may move), else absolute.
std::string recorded(const std::string& path, const std::string& folder) {
  const auto clean = [](const std::string& p) { return fs::absolute(p).lexically_normal(); };
  const fs::path inside = clean(path).lexically_relative(clean(folder + "/x").parent_path());
  const bool is_inside = !inside.empty() && *inside.begin() != "..";
  return is_inside ? inside.string() : clean(path).string();
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
        "truth.json of the -o folder if there is one",
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
    app.add_option("--max-evaluations", max_evaluations_, "forward runs at most")
        ->check(CLI::Range(1, 100000));
    app.add_flag("--anew", anew_, "compute everything again, whatever an earlier start of this fit left");
  }

  ExitCode run(VerbContext& context) override {
    Progress& progress = context.progress;
    const fitting::Case c = fitting::load_case(context.options.file, context.options.settings);
    const std::string folder = context.output_folder();
    const Scene scene = load_scene(c.scene, c.scene_settings);
    const fitting::FitCase options = options_of(c, scene);
    const std::string tracks = fitting::tracks_path(c, folder), camera = fitting::camera_path(c, folder);
    const std::string footage = fitting::footage_path(c, folder);
    require_tracks_or_footage(c, tracks, folder);
    fitting::Camera seen_by = fitting::read_camera(camera);
    const ExitCode tracked = current_tracks(c, tracks, folder, context);
    if (tracked != ExitCode::ok) return tracked;
    for (const std::string& warning : scene_warnings(scene)) progress.warning(warning);
    fitting::FitInput input{.scene = scene,
                            .camera = std::move(seen_by),
                            .tracks = fitting::read_tracks(tracks),
                            .options = options,
                            .truth = {},
                            .evaluations = (fs::path(folder) / "evaluations").string(),
                            .anew = anew_};
    adopt_camera_name(input, context);
    const std::string truth = (fs::path(folder) / "truth.json").string();
    if (is_truth_of(truth, footage, tracks))
      input.truth = fitting::read_truth(truth, input.scene);
    else if (fs::exists(truth))
      progress.warning(truth + " is the truth of other footage: not compared");

    fitting::FitResult result = fitting::run_fit(input, observer(context, input.options));
    if (result.stopped) {
      progress.finish();
      progress.note("stopped after " + std::to_string(result.forward_runs) +
                    " forward runs. Results of an earlier fit in " + folder +
                    " are as they were; the same command without --anew goes on from here");
      return ExitCode::interrupted;
    }
    result.case_name = c.name;
    result.case_file = recorded(c.file, folder);
    result.settings = context.options.settings;
    result.scene_file = recorded(c.scene, folder);
    result.footage_file = recorded(footage, folder);
    result.tracks_file = recorded(tracks, folder);
    result.camera_file = recorded(camera, folder);
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
  static void require_tracks_or_footage(const fitting::Case& c, const std::string& tracks,
                                        const std::string& folder) {
    const std::string footage = fitting::footage_path(c, folder);
    if (fs::exists(tracks) || fs::exists(footage)) return;
    throw InputError(tracks, "no file, and no footage " + footage + " to track",
                     "tracks, or footage (of a camera, or made by 'rhytid render')");
  }

  /// The first stage of the main job, when nobody has done it yet or the tracks in `folder` are not those
  /// that the case asks for. Throws InputError rather than write over tracks that the command line had a say
  /// in, or take tracks for others that cannot be made.
  static ExitCode current_tracks(const fitting::Case& c, const std::string& tracks, const std::string& folder,
                                 VerbContext& context) {
    const std::string footage = fitting::footage_path(c, folder);
    const fs::path own = fs::path(folder) / "tracks.csv";
    const bool is_there = fs::exists(tracks);
    std::error_code ignored;
    if (is_there && !(fs::equivalent(tracks, own, ignored) && fs::exists(own.parent_path() / "track.json")))
      return ExitCode::ok;  // made elsewhere, or by something else
    const TrackJob job = track_job(c, folder, "", context.progress);
    if (is_there) {
      const auto outdated = outdated_tracks(tracks, footage, track_settings(job));
      if (!outdated) return ExitCode::ok;
      if (outdated->by_hand || !fs::exists(footage))
        throw InputError(
            tracks, "tracks " + outdated->why,
            "those of the case (track again; without " + tracks + " and with footage, fit does)");
      context.progress.note(tracks + " is " + outdated->why + ": tracking " + footage + " again");
    } else {
      context.progress.note("no tracks yet (" + tracks + "): tracking " + footage + " first");
    }
    const ExitCode code = track_footage(job, folder, context.options.threads, context.progress, context.out);
    if (code == ExitCode::ok && !fs::exists(tracks))
      throw InputError(tracks, "no file", "the name tracks.csv, which tracking writes");
    return code;
  }

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

  fitting::FitCase options_of(const fitting::Case& c, const Scene& scene) const {
    fitting::FitCase options = c.fit;
    if (!optimiser_.empty()) options.optimiser = optimiser_;
    if (max_evaluations_ > 0) options.max_evaluations = max_evaluations_;
    if (addresses_.empty()) return options;
    options.parameters.clear();
    for (const std::string& given : addresses_) {
      const std::string address = address_by_names(scene, given);
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
    o.note = [&progress](const std::string& text) { progress.note(text); };
    o.run = [&progress](const fitting::FitProgress& p) {
      std::string values;
      for (const double v : p.values) values += " " + text_of("%.4g", v);
      progress.note("run " + std::to_string(p.forward_runs) + " (" + text_of("%.1f", p.seconds) +
                    (p.replayed ? " s then): " : " s): ") +
                    (p.failed ? "failed: " + p.failure : "cost " + text_of("%.6g", p.cost)) + " at" + values);
      progress.step_done(p.forward_runs);
    };
    return o;
  }

  std::string optimiser_;
  std::vector<std::string> addresses_;
  int max_evaluations_ = 0;
  bool anew_ = false;
};

}  // namespace

std::unique_ptr<Verb> make_verb_fit() {
  return std::make_unique<Fit>();
}

}  // namespace rhytid::tools
