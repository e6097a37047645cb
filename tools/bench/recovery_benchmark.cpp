#include "tools/bench/recovery_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <opencv2/core/utility.hpp>

#include "fitting/case_camera.h"
#include "fitting/case_rules.h"
#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "sim/output/text.h"
#include "sim/scene/load.h"
#include "sim/time/model_digest.h"
#include "sim/time/program_digest.h"
#include "tools/bench/recovery_report.h"
#include "tools/render/twin_run.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {
namespace {

/// A variant of a case with what its draws depend on, and those that are there.
struct Study {
  std::string case_name, variant, description, folder, twin_folder;
  VariedCase varied;
  std::string depends_on = {};  ///< digest of case, command line and variant
  std::string files = {};       ///< digest of what the scenes name
  std::string scenes = {};      ///< digest of both
  int draws = 0;
  std::vector<std::optional<RecoveryDraw>> found = {};  ///< by draw
};

class RecoveryBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "recovery", "repeated twin studies: what fits find again, and how often their intervals hold it",
        "Simulates and draws the truth of each case once, films it with N draws of noise, tracks and fits "
        "each. "
        "Tables tell bias, spread and the reported deviations, how often 95 % intervals hold the truth, "
        "forward runs "
        "and time; variants tell how that changes with more noise, fewer tracks and models that are wrong in "
        "a known "
        "way. Writes recovery.csv, summary.csv, recovery.md, index.html, plots, and runs/CASE/VARIANT/DRAW "
        "into "
        "-o DIR. Draws that are finished are kept while settings, files and program are the same: the same "
        "command goes on after a stop, and with --shard I/N each of N processes does its part into the same "
        "folder; a last call without it makes the tables. Variants: " +
            names_text() + "."};
  }
  void add_options(CLI::App& app) override {
    app.add_option("files", files_, "case files, e.g. data/scenes/recovery_*/case.json")
        ->required()
        ->option_text("CASE ...");
    app.add_option("--set", settings_, "change one value of every case; may be repeated")
        ->option_text("/POINTER=VALUE")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    app.add_option("--draws", draws_, "of noise, of the case as it is (default 30)")
        ->check(CLI::Range(1, 100000));
    app.add_option("--variants", variants_, "names, 'all' or 'none' (default)")
        ->delimiter(',')
        ->option_text("NAME,...");
    app.add_option("--variant-draws", variant_draws_, "of every variant (default 8)")
        ->check(CLI::Range(1, 100000));
    app.add_option("--shard", shard_, "do part I of N only, and no tables")->option_text("I/N");
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    cv::setNumThreads(context.options.threads);
    const Shard shard = parse_shard(shard_);
    // All models are built first: what is wrong with the last shows before the first runs.
    std::vector<Study> studies = planned(folder);
    std::size_t run = 0;
    for (Study& study : studies) {
      std::vector<int> missing;
      for (int draw = 0; draw < study.draws; ++draw) {
        study.found[static_cast<std::size_t>(draw)] = kept(study, draw);
        if (!study.found[static_cast<std::size_t>(draw)] && shard.takes(run)) missing.push_back(draw);
        ++run;
      }
      context.progress.note(study.case_name + ", " + study.variant + ": " +
                            std::to_string(study.draws - static_cast<int>(missing.size())) + " of " +
                            counted(study.draws, "draw") + " kept or left to others");
      const bool is_whole = missing.empty() || do_draws(context, study, missing);
      if (shard.count == 1) write_recovery_report(folder, groups_of(studies));
      if (!is_whole) return ExitCode::interrupted;
    }
    if (shard.count > 1) return ExitCode::ok;
    context.out << write_recovery_report(folder, groups_of(studies)) << "\n" << folder << "/index.html\n";
    return ExitCode::ok;
  }

 private:
  static std::string names_text() {
    std::string text;
    for (const RecoveryVariant& v : recovery_variants())
      text += (text.empty() ? "" : "; ") + v.name + " (" + v.description + ")";
    return text;
  }

  std::vector<RecoveryVariant> wanted() const {
    std::vector<RecoveryVariant> list = {recovery_variants().front()};
    for (const std::string& name : variants_) {
      if (name == "none" && variants_.size() == 1) return list;
      const auto& all = recovery_variants();
      const auto same =
          std::find_if(all.begin(), all.end(), [&](const RecoveryVariant& v) { return v.name == name; });
      if (name == "all" && variants_.size() == 1) return all;
      if (same == all.end())
        throw InputError("--variants", "'" + name + "'", "all, none, or of " + names_text());
      if (std::none_of(list.begin(), list.end(), [&](const RecoveryVariant& v) { return v.name == name; }))
        list.push_back(*same);
    }
    return list;
  }

  /// The case as it is of every case, then the variants of every case that has them.
  std::vector<Study> planned(const std::string& folder) const {
    std::vector<fitting::Case> cases;
    std::vector<std::string> case_names;
    for (const std::string& file : files_) {
      cases.push_back(fitting::load_case(file, settings_));
      if (!cases.back().clips.empty())
        throw InputError(file + ": /clips", "several clips", "a case of one clip, seen by one camera");
      case_names.push_back(cases.back().name);
    }
    case_names = file_names(case_names);
    std::vector<Study> studies;
    for (const RecoveryVariant& variant : wanted())
      for (std::size_t k = 0; k < cases.size(); ++k) {
        const fitting::Case& c = cases[k];
        if (c.truth_scene.empty()) throw InputError(c.file + ": /truth", "nothing", "a truth to find again");
        const auto varied =
            varied_case(c, load_scene(c.scene, c.scene_settings), truth_scene(c), variant.name);
        if (!varied) continue;
        const std::string own = folder + "/runs/" + case_names[k];
        Study study{case_names[k],
                    variant.name,
                    variant.description,
                    own + "/" + variant.name,
                    own + (variant.name == "same_discretisation" ? "/truth_of_the_fit" : "/truth"),
                    *varied};
        study.draws = variant.name == recovery_variants().front().name ? draws_ : variant_draws_;
        study.found.resize(static_cast<std::size_t>(study.draws));
        identify(study);
        studies.push_back(std::move(study));
      }
    return studies;
  }

  void identify(Study& study) const {
    const fitting::Case& c = study.varied.c;
    const SceneModel fit(load_scene(c.scene, c.scene_settings)), truth(truth_scene(c));
    (void)frame_stride(fit.scene(), truth.scene());
    require_frames(fit.scene(), c.scene);
    Digest scenes, depends_on, files;
    scenes.text(scene_to_json(fit.scene()).dump() + scene_to_json(truth.scene()).dump());
    depends_on.text(read_with_extends(c.file, fitting::case_rule_tree(), "case").json.dump());
    for (const std::string& setting : settings_) depends_on.text(setting);
    depends_on.text(study.variant);
    files.text(content_digest(fit.model()) + content_digest(truth.model()));
    if (!c.camera.empty()) files.text(fitting::camera_digest(fitting::read_case_camera(c)));
    study.scenes = scenes.hex(), study.depends_on = depends_on.hex(), study.files = files.hex();
  }

  static VariantIdentity identity_of(const Study& study) {
    return {study.scenes, study.depends_on, study.files, program_digest()};
  }

  static std::string folder_of(const Study& study, int draw) {
    char number[16];
    std::snprintf(number, sizeof(number), "%04d", draw);
    return study.folder + "/" + number;
  }

  static std::optional<RecoveryDraw> kept(const Study& study, int draw) {
    const auto result = read_variant(folder_of(study, draw));
    if (!result || !result->finished() || result->identity != identity_of(study)) return std::nullopt;
    return read_draw(*result);
  }

  /// False when interrupted.
  static bool do_draws(VerbContext& context, Study& study, const std::vector<int>& missing) {
    const fitting::Case& c = study.varied.c;
    const Scene fit = load_scene(c.scene, c.scene_settings);
    const SceneModel truth(truth_scene(c));
    const auto twin = make_recovery_twin(c, fit, truth, study.twin_folder, context.progress);
    if (!twin) return false;
    const DrawSetup setup{study.varied, fit, study.twin_folder,
                          track_job(c, study.twin_folder, study.twin_folder + "/footage", context.progress)};
    context.progress.stage(study.case_name + ", " + study.variant, static_cast<int>(missing.size()));
    int done = 0;
    for (const int draw : missing) {
      const std::string own = folder_of(study, draw);
      std::filesystem::create_directories(own);
      const auto found = run_recovery_draw(*twin, setup, draw, own, context.progress);
      if (!found) return false;
      write_variant(own, draw_result(*found, identity_of(study)));
      study.found[static_cast<std::size_t>(draw)] = *found;
      context.progress.step_done(++done);
    }
    return true;
  }

  static std::vector<RecoveryGroup> groups_of(const std::vector<Study>& studies) {
    std::vector<RecoveryGroup> groups;
    for (const Study& study : studies) {
      RecoveryGroup group{study.case_name, study.variant, study.description, {}};
      for (const auto& draw : study.found)
        if (draw) group.draws.push_back(*draw);
      if (!group.draws.empty()) groups.push_back(std::move(group));
    }
    return groups;
  }

  std::vector<std::string> files_, settings_, variants_;
  std::string shard_;
  int draws_ = 30, variant_draws_ = 8;
};

}  // namespace

std::unique_ptr<Benchmark> make_recovery_benchmark() {
  return std::make_unique<RecoveryBenchmark>();
}

}  // namespace rhytid::tools
