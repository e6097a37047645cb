#include "tools/bench/pareto_variant.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "adjoint/output_values.h"
#include "adjoint/parameter_space.h"
#include "adjoint/resultant_force.h"
#include "adjoint/stored_energy.h"
#include "adjoint/sweeps.h"
#include "sim/core/error.h"
#include "sim/output/csv.h"
#include "tools/bench/timing.h"
#include "tools/peak_memory.h"
#include "tools/run_observer.h"
#include "tools/study/wrinkle_recorder.h"

namespace rhytid::tools {
namespace {

/// Displacements of the comparison's points.
class Points {
 public:
  Points(const SkinMesh& mesh, const SurfaceSamples& samples)
      : samples_(samples), on_surface_(material_points(samples)), interpolation_(mesh, on_surface_) {}

  const std::vector<adjoint::MaterialPoint>& on_surface() const { return on_surface_; }
  int count() const { return interpolation_.num_points(); }
  /// [points on the surface · 3], as PointPositions orders them.
  VectorXd displacements(const VectorXd& u) const {
    VectorXd all(3 * count());
    for (int p = 0; p < count(); ++p) all.segment<3>(3 * p) = interpolation_.displacement(p, u);
    return all;
  }
  void add_rows(int frame, const VectorXd& u, CsvTable& table) const {
    const VectorXd d = displacements(u);
    int found = 0;
    for (std::size_t k = 0; k < samples_.places().size(); ++k) {
      Vec3 x = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
      if (samples_.places()[k].face >= 0) x = d.segment<3>(3 * found++);
      table.add_numbers({static_cast<double>(frame), static_cast<double>(k), x[0], x[1], x[2]});
    }
  }

 private:
  static std::vector<adjoint::MaterialPoint> material_points(const SurfaceSamples& samples) {
    std::vector<adjoint::MaterialPoint> points;
    for (const SurfaceSamples::Place& place : samples.places())
      if (place.face >= 0) points.push_back({place.face, place.u, place.v, true});
    return points;
  }

  const SurfaceSamples& samples_;
  std::vector<adjoint::MaterialPoint> on_surface_;
  adjoint::PointInterpolation interpolation_;
};

void add_wrinkles(const SceneModel& scene_model, const WrinkleMeasure& measure, const VectorXd& u,
                  VariantResult& result) {
  const WrinkleSamples samples = place_samples(scene_model.model().mesh, measure);
  if (!samples.line && !samples.window) return;
  const SurfaceSamples& chosen = samples.line ? *samples.line : *samples.window;
  const MatrixXd waves = band_pass(chosen.heights(u), chosen.spacing(), measure.band);
  if (samples.line)
    result.columns.push_back({"crests", "", count_wrinkles(VectorXd(waves.col(0)), chosen.spacing()).crests});
  const WrinkleDescriptors d = describe(wrinkle_sums(waves, chosen.spacing()));
  result.columns.push_back({"wavelength", "mm", d.wavelength});
  result.columns.push_back({"amplitude", "mm", d.amplitude});
}

/// Forces into a file, stored energy of the last frame into the result.
void add_forces(const SceneModel& scene_model, const Trajectory& run, const std::string& folder,
                VariantResult& result) {
  std::vector<CsvColumn> header = {{"frame", ""}};
  std::vector<std::shared_ptr<const adjoint::Output>> parts;
  for (const ColliderScene& collider : scene_model.scene().colliders) {
    for (const char* axis : {"_x", "_y", "_z"}) header.push_back({collider.name + axis, "N"});
    parts.push_back(std::make_shared<adjoint::ResultantForce>(
        adjoint::collider_force(scene_model.model(), collider.name)));
  }
  parts.push_back(std::make_shared<adjoint::StoredEnergy>(scene_model.model()));
  const std::vector<VectorXd> values = adjoint::output_values(scene_model.model(), scene_model.native(), run,
                                                              adjoint::CombinedOutput(std::move(parts)));
  CsvTable forces(header);
  for (std::size_t f = 1; f < values.size(); ++f) {
    std::vector<double> row = {static_cast<double>(f)};
    row.insert(row.end(), values[f].begin(), values[f].end() - 1);
    forces.add_numbers(row);
  }
  forces.write(folder + "/forces.csv");
  result.columns.push_back({"stored_energy", "mJ", values.back()[values.back().size() - 1]});
}

void add_gradient(const SceneModel& scene_model, const std::vector<std::string>& addresses,
                  const Points& points, const Trajectory& run, VariantResult& result) {
  const adjoint::PointPositions output(scene_model.model().mesh, points.on_surface(), run.frames());
  std::vector<VectorXd> weights(static_cast<std::size_t>(run.frames()) + 1);
  const VectorXd d = points.displacements(run.at_frame(run.frames()).u);
  weights.back() = 2. / points.count() * d;
  result.columns.push_back({"mean_square", "mm2", d.squaredNorm() / points.count()});
  if (addresses.empty()) return;
  const adjoint::ParameterSpace space(scene_model, addresses);
  const double start = cpu_seconds();
  try {
    const adjoint::AdjointResult sweep =
        adjoint::adjoint_sweep(scene_model.model(), scene_model.native(), run, output, weights);
    const VectorXd gradient = space.jacobian().transpose() * sweep.native_bar;
    for (int k = 0; k < space.size(); ++k)
      result.columns.push_back(
          {gradient_column + addresses[static_cast<std::size_t>(k)], "mm2", gradient[k]});
    result.columns.push_back({"adjoint_cpu", "s", cpu_seconds() - start});
  } catch (const adjoint::GradientError& error) {
    result.reason = std::string("no gradient: ") + error.what();
  }
}

}  // namespace

SurfaceSamples comparison_points(const SkinMesh& mesh, const Comparison& comparison) {
  SurfaceSamples samples(mesh, comparison.window, comparison.spacing);
  if (2 * samples.missing() > samples.rows() * samples.columns())
    throw InputError("/compare/window", "most points beside the surface",
                     "a window on the surface of the scene");
  return samples;
}

std::optional<VariantResult> measure_pareto_variant(const SceneModel& scene_model,
                                                    const Experiment& experiment, int repeats,
                                                    const std::string& folder, VariantResult result,
                                                    Progress& progress) {
  const Model& model = scene_model.model();
  const SurfaceSamples samples = comparison_points(model.mesh, *experiment.comparison);
  const Points points(model.mesh, samples);
  const RunOptions options = scene_model.run_options();
  const RunObserver observer = progress_observer(progress);
  Trajectory run;
  std::vector<double> seconds;
  double peak = 0;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    run = {};
    progress.stage(result.name, options.frames);
    (void)take_peak_memory();
    const double start = cpu_seconds();
    run = simulate(model, scene_model.native(), options, observer);
    seconds.push_back(cpu_seconds() - start);
    peak = take_peak_memory().value_or(0);
    progress.finish();
    if (progress.interrupted()) return std::nullopt;
  }
  long iterations = 0, evaluations = 0, factorisations = 0;
  for (const StepRecord& record : run.steps) {
    iterations += record.report.iterations;
    evaluations += record.report.evaluations;
    factorisations += record.report.factorisations;
  }
  result.status = run.complete ? "complete" : "not_converged";
  result.reason = run.failure;
  const auto add = [&](const char* name, const char* unit, double value) {
    result.columns.push_back({name, unit, value});
  };
  add("nodes", "", model.num_nodes());
  add("frames", "", run.frames());
  add("steps", "", static_cast<double>(run.steps.size()));
  add("iterations", "", static_cast<double>(iterations));
  add("evaluations", "", static_cast<double>(evaluations));
  add("factorisations", "", static_cast<double>(factorisations));
  add("cpu", "s", median(seconds));
  add("peak_memory", "MB", peak);
  CsvTable displacements({{"frame", ""}, {"point", ""}, {"x", "mm"}, {"y", "mm"}, {"z", "mm"}});
  for (int f = 1; f <= run.frames(); ++f) points.add_rows(f, run.at_frame(f).u, displacements);
  displacements.write(folder + "/displacements.csv");
  if (run.complete) {
    add_forces(scene_model, run, folder, result);
    add_wrinkles(scene_model, experiment.measure, run.at_frame(run.frames()).u, result);
    add_gradient(scene_model, experiment.comparison->parameters, points, run, result);
  }
  write_variant(folder, result);
  return result;
}

}  // namespace rhytid::tools
