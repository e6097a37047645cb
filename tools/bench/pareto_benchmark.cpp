#include "tools/bench/pareto_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <set>

#include "adjoint/parameter_space.h"
#include "sim/core/error.h"
#include "sim/core/parallel.h"
#include "sim/scene/load.h"
#include "tools/bench/pareto_report.h"
#include "tools/bench/pareto_variant.h"
#include "tools/study/study_run.h"
#include "tools/study/wrinkle_recorder.h"

namespace rhytid::tools {
namespace {

class ParetoBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "pareto", "error against run time: the variants of an experiment against finer ones",
        "Runs the variants of an experiment file with `compare` (data/scenes/*/pareto.json) and sets their "
        "errors against finer references beside CPU seconds and memory: displacements of material points, "
        "wavelength and amplitude of wrinkles, force on the colliders, stored energy, and derivatives of a "
        "functional by an adjoint sweep. Writes pareto.csv, pareto.md, a plot for every group and measure "
        "and runs/VARIANT into -o DIR. What is finished is kept while settings, files and program are the "
        "same: the same command goes on after a stop. Use --threads 1 on a machine that is shared."};
  }
  void add_options(CLI::App& app) override {
    app.add_option("file", file_, "an experiment file with `compare`")->required()->option_text("FILE");
    app.add_option("--set", settings_, "change one value of the scene; may be repeated")
        ->option_text("/POINTER=VALUE")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    app.add_option("--size", size_, "quick (default) or full")
        ->check(CLI::IsMember({"quick", "full"}))
        ->option_text("SIZE");
    app.add_option("--repeats", repeats_, "runs of every variant, medians are reported (default 1)")
        ->check(CLI::Range(1, 1000));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    const Experiment experiment =
        load_experiment(file_, size_ == "full" ? StudySize::full : StudySize::quick);
    if (!experiment.comparison || experiment.comparison->groups.empty())
      throw InputError(file_ + ": /compare", experiment.comparison ? "no group at this size" : "nothing",
                       "what is to be compared");
    const std::vector<Variant> variants = compared(experiment);
    // All models are built first: what is wrong with the last shows before the first runs.
    std::map<std::string, VariantIdentity> identities;
    for (const Variant& v : variants) identities[v.name] = identity_of(experiment, v);
    std::map<std::string, ParetoRun> runs;
    for (const Variant& v : variants) {
      const std::string own = folder + "/runs/" + v.name;
      std::optional<VariantResult> result = read_variant(own);
      if (result && result->finished() && result->identity == identities[v.name]) {
        context.progress.note(v.name + ": " + result->status + " before, kept");
      } else {
        std::filesystem::create_directories(own);
        // What is there belongs to other settings from now on, however this run ends.
        write_variant(own, {v.name, {}, "running", "", {}});
        const SceneModel scene_model(load_scene(experiment.scene, settings_of(v)));
        result = measure_pareto_variant(scene_model, experiment, repeats_, own,
                                        {v.name, identities[v.name], "running", "", {}}, context.progress);
        if (!result) return ExitCode::interrupted;
      }
      runs[v.name] = read_pareto_run(own, *result);
      write_pareto_report(folder, experiment.name, experiment.comparison->groups, runs);
    }
    context.out << write_pareto_report(folder, experiment.name, experiment.comparison->groups, runs) << "\n"
                << folder << "/pareto.csv\n";
    return ExitCode::ok;
  }

 private:
  /// The variants of all groups, references first: with them tables mean something before the end.
  static std::vector<Variant> compared(const Experiment& experiment) {
    std::set<std::string> references, wanted;
    for (const ComparisonGroup& group : experiment.comparison->groups) {
      references.insert(group.reference);
      wanted.insert(group.variants.begin(), group.variants.end());
    }
    std::vector<Variant> list;
    for (const bool first : {true, false})
      for (const Variant& v : experiment.variants) {
        const bool is_reference = references.count(v.name) > 0;
        if (first ? is_reference : !is_reference && wanted.count(v.name) > 0) list.push_back(v);
      }
    return list;
  }

  std::vector<Setting> settings_of(const Variant& v) const {
    std::vector<Setting> all = v.settings;
    for (const std::string& text : settings_) all.push_back({text});
    return all;
  }

  /// Throws InputError when the variant cannot be run, measured or differentiated.
  VariantIdentity identity_of(const Experiment& experiment, const Variant& v) const {
    try {
      const SceneModel built(load_scene(experiment.scene, settings_of(v)));
      require_frames(built.scene(), v.name);
      (void)comparison_points(built.model().mesh, *experiment.comparison);
      (void)place_samples(built.model().mesh, experiment.measure);
      const adjoint::ParameterSpace space(built, experiment.comparison->parameters);
      return study_identity(built.scene(), built.model(),
                            experiment.measure_json.dump() + experiment.comparison->depends_on.dump() +
                                " repeats " + std::to_string(repeats_) + " threads " +
                                std::to_string(num_threads()));
    } catch (const InputError& error) {
      throw InputError(experiment.file + ": variant " + v.name + ": " + error.what());
    }
  }

  std::string file_, size_ = "quick";
  std::vector<std::string> settings_;
  int repeats_ = 1;
};

}  // namespace

std::unique_ptr<Benchmark> make_pareto_benchmark() {
  return std::make_unique<ParetoBenchmark>();
}

}  // namespace rhytid::tools
