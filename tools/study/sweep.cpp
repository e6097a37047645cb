#include "tools/study/sweep.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <ostream>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/scene/scene_model.h"
#include "tools/forward_run.h"
#include "tools/peak_memory.h"
#include "tools/study/parameter_sets.h"
#include "tools/study/study_run.h"
#include "tools/study/sweep_report.h"
#include "tools/study/variant_result.h"
#include "tools/study/wrinkle_recorder.h"

namespace rhytid::tools {
namespace {

/// Tables read the results of all runs: made after every run they would take the square of a large grid's
/// time. They wait until so many times what they last took has gone by.
constexpr double kBetweenTables = 20;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

class Sweep {
 public:
  Sweep(VerbContext& context, const Experiment& experiment, const SweepOptions& options)
      : context_(context), experiment_(experiment), folder_(context.options.output), options_(options) {}

  ExitCode run() {
    for (const std::string& name : options_.only)
      if (std::none_of(experiment_.variants.begin(), experiment_.variants.end(),
                       [&](const Variant& v) { return v.name == name; }))
        throw InputError("--only", "'" + name + "'", "one of " + variant_names(experiment_));
    // All models are built first: what is wrong with the last shows before the first runs.
    for (const Variant& v : experiment_.variants)
      if (is_wanted(v)) {
        if (is_of_plan(folder_of(v)))
          throw InputError(folder_of(v), "a swipe of `study plan`",
                           "a folder of its own for the sweep, by -o");
        identities_[v.name] = identity_of(v);
      }
    context_.output_folder();
    for (const Variant& v : experiment_.variants)
      if (!is_wanted(v)) identify_earlier(v);
    ExitCode worst = ExitCode::ok;
    for (const Variant& v : experiment_.variants) {
      if (!is_wanted(v)) continue;
      ExitCode code = ExitCode::ok;
      try {
        code = run(v);
      } catch (...) {
        report();  // with what the variants before it left
        throw;
      }
      if (code == ExitCode::interrupted) {
        report();
        return code;
      }
      if (now() >= next_report_) report();
      if (code != ExitCode::ok) worst = code;
    }
    report();
    if (is_part()) {
      context_.out << "part " << options_.shard.index << " of " << options_.shard.count << " is in "
                   << folder_ << "; the same command without --shard makes the tables\n";
      return worst;
    }
    context_.out << "written to " << folder_
                 << ": results.csv, results.md, index.html, and a folder per variant\n";
    if (const std::string text = left_out(); !text.empty()) context_.out << text << '\n';
    return worst;
  }

 private:
  bool is_wanted(const Variant& v) const {
    if (!options_.shard.takes(static_cast<std::size_t>(&v - experiment_.variants.data()))) return false;
    return options_.only.empty() ||
           std::find(options_.only.begin(), options_.only.end(), v.name) != options_.only.end();
  }
  std::string folder_of(const Variant& v) const { return folder_ + "/" + v.name; }
  /// The command line has the last word.
  std::vector<Setting> settings_of(const Variant& v) const {
    std::vector<Setting> all = v.settings;
    for (const std::string& text : context_.options.settings) all.push_back({text});
    return all;
  }

  /// What the variant's result depends on. Throws InputError when it cannot be run or measured.
  VariantIdentity identity_of(const Variant& v) const {
    try {
      check_swept_values(experiment_, v, context_.options.settings);
      const SceneModel built(load_scene(experiment_.scene, settings_of(v)));
      place_samples(built.model().mesh, experiment_.measure);
      return study_identity(built.scene(), built.model(), experiment_.measure_json.dump());
    } catch (const InputError& error) {
      const std::string text = error.what();  // a setting's place begins with the experiment
      throw InputError(text.starts_with(experiment_.file + ":")
                           ? text
                           : experiment_.file + ": variant " + v.name + ": " + text);
    }
  }
  /// Of a variant that is not asked for, if it has a result and can still be built.
  void identify_earlier(const Variant& v) {
    if (const auto earlier = read_variant(folder_of(v)); !earlier || !earlier->finished()) return;
    try {
      identities_[v.name] = identity_of(v);
    } catch (const InputError& error) {
      context_.progress.note(error.what());
    }
  }

  ExitCode run(const Variant& v) {
    CommonOptions own = context_.options;
    own.file = experiment_.scene;
    own.settings.clear();
    for (const Setting& setting : settings_of(v)) own.settings.push_back(setting.text);
    own.output = folder_of(v);
    VerbContext context{own, context_.program, context_.progress, context_.out};
    context.output_folder();
    VariantIdentity& identity = identities_.at(v.name);
    const std::optional<VariantResult> earlier = read_variant(own.output);
    if (earlier && earlier->finished() && earlier->identity == identity && !options_.anew) {
      context_.progress.note(v.name + ": " + earlier->status + " before, kept");
      return earlier->status == "complete" ? ExitCode::ok : ExitCode::not_converged;
    }
    identity = identity_of(v);  // files may have changed while others ran
    const bool is_same = earlier && earlier->identity == identity && !options_.anew;
    std::string why;
    if (earlier && earlier->finished() && !options_.anew)
      why = " anew, with other " + difference(identity, earlier->identity) + " than before";
    context_.progress.note(v.name + (is_same ? ": goes on" : ": starts" + why));
    VariantResult result{v.name, identity, "running", "", {}};
    // Until its checkpoint is gone, what lies there is that of another variant, to which a kill must not lead
    // back.
    if (!is_same) write_variant(own.output, {v.name, {}, "running", "", {}});
    (void)take_peak_memory();
    WrinkleRecorder recorder(experiment_.measure, [&] { write_variant(own.output, result); });
    const ExitCode code = run_forward(context, options_.frames, is_same, &recorder);
    if (code == ExitCode::interrupted) return code;
    result.columns = read_results(own.output);
    result.columns.push_back({"peak_memory", "MB", take_peak_memory().value_or(0)});
    result.status = code == ExitCode::ok ? "complete" : "not_converged";
    const auto record = nlohmann::json::parse(read_file(own.output + "/run.json"));
    result.reason = record["exit"]["reason"];
    write_variant(own.output, result);
    return code;
  }

  /// The result of a variant as it is asked for now, also from an earlier run; why there is none.
  std::optional<VariantResult> current(const Variant& v, std::string& reason) const {
    auto result = read_variant(folder_of(v));
    const auto identity = identities_.find(v.name);
    if (!result || !result->finished()) {
      reason = "not finished";
    } else if (identity == identities_.end()) {
      reason = "cannot be built any more";
    } else if (result->identity == identity->second) {
      return result;
    } else {
      reason = "finished with other " + difference(identity->second, result->identity);
    }
    return std::nullopt;
  }

  /// A sentence on the variants without a result; empty when all have one.
  std::string left_out() const {
    std::string text, reason;
    for (const Variant& v : experiment_.variants)
      if (!current(v, reason)) text += (text.empty() ? "Left out: " : ", ") + v.name + " (" + reason + ")";
    return text.empty() ? text : text + ".";
  }

  bool is_part() const { return options_.shard.count > 1; }

  /// Tables and page. Not of a part: other machines may be writing theirs into the same folder.
  void report() {
    if (is_part()) return;
    const double start = now();
    std::vector<VariantResult> results;
    std::string reason;
    for (const Variant& v : experiment_.variants)
      if (auto result = current(v, reason)) results.push_back(std::move(*result));
    write_sweep_report(folder_, experiment_, results, left_out());
    next_report_ = now() + kBetweenTables * (now() - start);
  }

  VerbContext& context_;
  const Experiment& experiment_;
  std::string folder_;
  const SweepOptions& options_;
  std::map<std::string, VariantIdentity> identities_;  ///< by name, of variants that can be built
  double next_report_ = 0;                             ///< s
};

}  // namespace

ExitCode run_sweep(VerbContext& context, const Experiment& experiment, const SweepOptions& options) {
  return Sweep(context, experiment, options).run();
}

}  // namespace rhytid::tools
