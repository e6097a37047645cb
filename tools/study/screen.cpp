#include "tools/study/screen.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <ostream>

#include "adjoint/surface_response.h"
#include "sim/core/digest.h"
#include "sim/core/error.h"
#include "tools/run_observer.h"
#include "tools/step_reading.h"
#include "tools/study/wrinkle_recorder.h"

namespace rhytid::tools {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Measures the last frame of runs.
class Measure {
 public:
  Measure(const Model& model, const WrinkleMeasure& wrinkles)
      : model_(model),
        wrinkles_(wrinkles),
        samples_(place_samples(model.mesh, wrinkles)),
        mean_square_(model.mesh) {}

  std::vector<ResultColumn> operator()(const StepEvent& event) const {
    std::vector<ResultColumn> columns;
    const std::vector<std::string> names = contact_names(model_);
    const StepReading reading = read_step(event.problem, event.state);
    for (std::size_t k = 0; k < names.size(); ++k)
      if (names[k] != "base") columns.push_back({"force_" + names[k], "N", reading.contacts[k].force.norm()});
    const VectorXd& u = event.state.u;
    columns.push_back({"rms_displacement", "mm", std::sqrt(mean_square_.values(1, event.state)[0])});
    double largest = 0;
    for (int c = 0; c < model_.mesh.num_columns; ++c)
      largest = std::max(largest, u.segment<3>(3 * model_.mesh.node(c, model_.mesh.num_levels - 1)).norm());
    columns.push_back({"max_displacement", "mm", largest});
    if (samples_.line) {
      const double spacing = samples_.line->spacing();
      const VectorXd heights = samples_.line->heights(u).col(0);
      columns.push_back(
          {"line_wrinkle_amplitude", "mm",
           describe(wrinkle_sums(band_pass(heights, spacing, wrinkles_.band), spacing)).amplitude});
    }
    if (samples_.window) {
      const double spacing = samples_.window->spacing();
      const MatrixXd heights = samples_.window->heights(u);
      columns.push_back(
          {"window_wrinkle_amplitude", "mm",
           describe(wrinkle_sums(band_pass(heights, spacing, wrinkles_.band), spacing)).amplitude});
    }
    return columns;
  }

 private:
  const Model& model_;
  WrinkleMeasure wrinkles_;
  WrinkleSamples samples_;
  adjoint::MeanSquareDisplacement mean_square_;
};

class Screen {
 public:
  Screen(VerbContext& context, const ScreenOptions& options)
      : context_(context),
        options_(options),
        loaded_(load_study_scene(context, options.size, options.variant)),
        scene_model_(loaded_.scene),
        measure_(scene_model_.model(), loaded_.measure),
        identity_(study_identity(scene_model_.scene(), scene_model_.model(), loaded_.measure_text)) {}

  ExitCode run() {
    require_frames(scene_model_.scene(), context_.options.file);
    choose_ranges();
    const auto inputs = static_cast<int>(result_.ranges.size());
    if (options_.sobol_samples > 0) {
      result_.points = sobol_design(inputs, options_.sobol_samples, options_.seed);
    } else {
      design_ = morris_design(inputs, options_.trajectories, options_.levels, options_.seed);
      result_.points = design_.points;
    }
    collect_points();
    check_corners();
    folder_ = context_.output_folder();
    const ExitCode code = run_missing();
    judge();
    if (options_.shard.count > 1) {  // other machines may be writing into the same folder
      context_.out << screen_text(result_) << "part " << options_.shard.index << " of "
                   << options_.shard.count << " is in " << folder_
                   << "; the same command without --shard makes the tables\n";
      return code;
    }
    write_screen(folder_, scene_model_.scene().name, result_);
    context_.out << screen_text(result_) << "written to " << folder_ << ": index.html, runs.csv and more\n";
    return code;
  }

 private:
  void choose_ranges() {
    const Scene& scene = scene_model_.scene();
    if (!options_.ranges.empty()) {
      result_.ranges = read_ranges(options_.ranges, scene);
      return;
    }
    for (const ParameterSpec& spec : study_parameters(scene, options_.addresses))
      result_.ranges.push_back(range_around(spec, options_.factor));
    if (result_.ranges.empty())
      throw InputError(context_.options.file, "no parameters", "a scene with at least one");
  }

  /// Points of trajectories may coincide: each is run once.
  void collect_points() {
    std::map<std::vector<double>, std::size_t> known;
    for (Eigen::Index i = 0; i < result_.points.rows(); ++i) {
      std::vector<double> x(result_.points.cols());
      for (std::size_t k = 0; k < x.size(); ++k) x[k] = result_.points(i, static_cast<Eigen::Index>(k));
      const auto [it, is_new] = known.try_emplace(x, first_.size());
      if (is_new) first_.push_back(i);
      run_of_point_.push_back(it->second);
    }
    result_.runs = static_cast<int>(first_.size());
    found_.resize(first_.size());
  }

  Scene scene_at(std::size_t run) const {
    Scene scene = scene_model_.scene();
    for (std::size_t k = 0; k < result_.ranges.size(); ++k)
      set_parameter(scene, result_.ranges[k].spec.address,
                    result_.ranges[k].at(result_.points(first_[run], static_cast<Eigen::Index>(k))));
    return scene;
  }
  /// What a scene may not hold shows before the first run.
  void check_corners() const {
    for (std::size_t run = 0; run < first_.size(); ++run) (void)scene_at(run);
  }
  std::string folder_of(std::size_t run) const {
    char name[32];
    std::snprintf(name, sizeof name, "/runs/%05zu", run + 1);
    return folder_ + name;
  }
  /// The model is that of the scene's own values but for native parameters, which the values tell.
  VariantIdentity identity_of(std::size_t run) const {
    VariantIdentity identity = identity_;
    Digest digest;
    digest.text(identity.scene);
    for (std::size_t k = 0; k < result_.ranges.size(); ++k) {
      digest.text(result_.ranges[k].spec.address);
      digest.number(result_.ranges[k].at(result_.points(first_[run], static_cast<Eigen::Index>(k))));
    }
    identity.scene = digest.hex();
    return identity;
  }

  ExitCode run_missing() {
    ExitCode worst = ExitCode::ok;
    std::vector<std::size_t> missing;
    for (std::size_t run = 0; run < first_.size(); ++run) {
      const auto earlier = read_variant(folder_of(run));
      const bool is_current = earlier && earlier->finished() && earlier->identity == identity_of(run);
      const bool is_mine = options_.shard.takes(run);
      if (is_current && !(options_.anew && is_mine)) {
        found_[run] = *earlier;
      } else if (is_mine) {
        missing.push_back(run);
      }
    }
    if (missing.size() < first_.size())
      context_.progress.note(std::to_string(first_.size() - missing.size()) + " of " +
                             std::to_string(first_.size()) + " runs finished before, or of other shards");
    context_.progress.stage("runs", static_cast<int>(missing.size()));
    for (std::size_t i = 0; i < missing.size(); ++i) {
      const ExitCode code = run_one(missing[i]);
      if (code == ExitCode::interrupted) return code;
      context_.progress.step_done(static_cast<int>(i) + 1);
    }
    context_.progress.finish();
    for (const auto& one : found_)
      if (one && one->status != "complete") worst = ExitCode::not_converged;
    return worst;
  }

  ExitCode run_one(std::size_t run) {
    VariantResult result{std::to_string(run + 1), identity_of(run), "complete", "", {}};
    RunOptions options = scene_model_.run_options();
    options.keep_states = false;
    RunObserver observer = progress_observer(context_.progress);
    observer.step = [&](const StepEvent& event) {
      if (event.frame_done && event.record.frame == options.frames) result.columns = measure_(event);
    };
    const Trajectory trajectory =
        simulate(scene_model_.model(), scene_model_.native(scene_at(run)), options, observer);
    if (!trajectory.complete) {
      if (context_.progress.interrupted()) return ExitCode::interrupted;
      result.status = "not_converged", result.reason = trajectory.failure;
      result.columns.clear();
    }
    std::filesystem::create_directories(folder_of(run));
    write_variant(folder_of(run), result);
    found_[run] = std::move(result);
    return ExitCode::ok;
  }

  void judge() {
    for (const auto& one : found_) {
      result_.finished += one ? 1 : 0;
      result_.failed += one && one->status != "complete" ? 1 : 0;
      if (one && result_.outputs.empty()) result_.outputs = one->columns;
    }
    const Eigen::Index rows = result_.points.rows(),
                       columns = static_cast<Eigen::Index>(result_.outputs.size());
    result_.values = MatrixXd::Constant(rows, columns, kNan);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const auto& one = found_[run_of_point_[static_cast<std::size_t>(i)]];
      result_.status.push_back(one ? one->status : "missing");
      for (Eigen::Index k = 0; one && k < static_cast<Eigen::Index>(one->columns.size()); ++k)
        result_.values(i, k) = one->columns[static_cast<std::size_t>(k)].value.value_or(kNan);
    }
    const auto inputs = static_cast<int>(result_.ranges.size());
    result_.is_sobol = options_.sobol_samples > 0;
    for (Eigen::Index k = 0; k < columns; ++k)
      if (result_.is_sobol)
        result_.sobol.push_back(
            sobol_indices(inputs, options_.sobol_samples, result_.values.col(k), options_.seed));
      else
        result_.morris.push_back(morris_effects(design_, result_.values.col(k)));
  }

  VerbContext& context_;
  const ScreenOptions& options_;
  StudyScene loaded_;
  SceneModel scene_model_;
  Measure measure_;
  VariantIdentity identity_;
  std::string folder_;
  MorrisDesign design_;
  ScreenResult result_;
  std::vector<Eigen::Index> first_;  ///< point of each run
  std::vector<std::size_t> run_of_point_;
  std::vector<std::optional<VariantResult>> found_;  ///< per run
};

}  // namespace

ExitCode run_screen(VerbContext& context, const ScreenOptions& options) {
  return Screen(context, options).run();
}

}  // namespace rhytid::tools
