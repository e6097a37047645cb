#include "tools/study/sweep.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <ostream>

#include "sim/core/build_info.h"
#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "tools/forward_run.h"
#include "tools/study/sweep_report.h"
#include "tools/study/variant_result.h"
#include "tools/study/wrinkle_recorder.h"

namespace rhytid::tools {
namespace {

namespace fs = std::filesystem;

/// What a variant's result depends on.
std::string identity_of(const Scene& scene, const Experiment& experiment) {
  Digest digest;
  digest.text(build_info().version);
  digest.text(scene_to_json(scene).dump());
  digest.text(experiment.measure_json.dump());
  if (!scene.skin.surface.file.empty()) digest.text(read_file(scene.skin.surface.file));
  return digest.hex();
}

/// The largest resident memory since the last call, MB; 0 where the system does not tell.
double take_peak_memory() {
  double peak = 0;
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) peak = std::strtod(line.c_str() + 6, nullptr) / 1024;
  std::ofstream("/proc/self/clear_refs") << "5";
  return peak;
}

class Sweep {
 public:
  Sweep(VerbContext& context, const Experiment& experiment, std::string folder, const SweepOptions& options)
      : context_(context), experiment_(experiment), folder_(std::move(folder)), options_(options) {}

  ExitCode run() {
    for (const std::string& name : options_.only)
      if (std::none_of(experiment_.variants.begin(), experiment_.variants.end(),
                       [&](const Variant& v) { return v.name == name; }))
        throw InputError("--only", "'" + name + "'", "one of " + names());
    // All scenes are read first: what is wrong with the last shows before the first runs.
    for (const Variant& v : experiment_.variants)
      if (is_wanted(v)) load_scene(experiment_.scene, settings_of(v));
    ExitCode worst = ExitCode::ok;
    for (const Variant& v : experiment_.variants) {
      if (!is_wanted(v)) continue;
      const ExitCode code = run(v);
      report();
      if (code == ExitCode::interrupted) return code;
      if (code != ExitCode::ok) worst = code;
    }
    context_.out << "written to " << folder_
                 << ": results.csv, results.md, index.html, and a folder per variant\n";
    return worst;
  }

 private:
  bool is_wanted(const Variant& v) const {
    return options_.only.empty() ||
           std::find(options_.only.begin(), options_.only.end(), v.name) != options_.only.end();
  }
  std::string names() const {
    std::string text;
    for (const Variant& v : experiment_.variants) text += (text.empty() ? "" : ", ") + v.name;
    return text;
  }
  /// The command line has the last word.
  std::vector<std::string> settings_of(const Variant& v) const {
    std::vector<std::string> all = v.settings;
    all.insert(all.end(), context_.options.settings.begin(), context_.options.settings.end());
    return all;
  }

  ExitCode run(const Variant& v) {
    CommonOptions own = context_.options;
    own.file = experiment_.scene;
    own.settings = settings_of(v);
    own.output = folder_ + "/" + v.name;
    VerbContext context{own, context_.program, context_.progress, context_.out};
    context.output_folder();
    const std::string identity = identity_of(load_scene(own.file, own.settings), experiment_);
    const std::optional<VariantResult> earlier = read_variant(own.output);
    const bool is_same = earlier && earlier->identity == identity;
    if (is_same && earlier->finished()) {
      context_.progress.note(v.name + ": " + earlier->status + " before, kept");
      return earlier->status == "complete" ? ExitCode::ok : ExitCode::not_converged;
    }
    context_.progress.note(v.name + (is_same ? ": goes on" : ": starts"));
    VariantResult result{v.name, identity, "running", "", {}};
    // Until its checkpoint is gone, what lies there is that of another variant, to which a kill must not lead
    // back.
    if (!is_same) write_variant(own.output, {v.name, "", "running", "", {}});
    take_peak_memory();
    WrinkleRecorder recorder(experiment_.measure, [&] { write_variant(own.output, result); });
    const ExitCode code = run_forward(context, options_.frames, is_same, &recorder);
    if (code == ExitCode::interrupted) return code;
    result.columns = read_results(own.output);
    result.columns.push_back({"peak_memory", "MB", take_peak_memory()});
    result.status = code == ExitCode::ok ? "complete" : "not_converged";
    const auto record = nlohmann::json::parse(read_file(own.output + "/run.json"));
    result.reason = record["exit"]["reason"];
    write_variant(own.output, result);
    return code;
  }

  /// Tables and page of all variants that are finished, also in earlier runs.
  void report() const {
    std::vector<VariantResult> results;
    for (const Variant& v : experiment_.variants)
      if (auto result = read_variant(folder_ + "/" + v.name); result && result->finished())
        results.push_back(std::move(*result));
    write_sweep_report(folder_, experiment_, results);
  }

  VerbContext& context_;
  const Experiment& experiment_;
  std::string folder_;
  const SweepOptions& options_;
};

}  // namespace

ExitCode run_sweep(VerbContext& context, const Experiment& experiment, const std::string& folder,
                   const SweepOptions& options) {
  return Sweep(context, experiment, folder, options).run();
}

}  // namespace rhytid::tools
