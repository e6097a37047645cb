#include "tools/run_record.h"

#include <algorithm>
#include <filesystem>

#include "sim/core/build_info.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "sim/scene/names.h"
#include "sim/solve/blas_info.h"
#include "tools/model_size.h"

namespace rhytid::tools {
namespace {

using nlohmann::ordered_json;

ordered_json schemes(const Scene& scene) {
  ordered_json layers = ordered_json::array();
  for (const LayerScene& l : scene.skin.layers)
    layers.push_back({{"name", l.name}, {"elements", l.elements}, {"order", l.order}});
  const bool stacked = scene.skin.scheme == ThicknessScheme::stacked;
  ordered_json j = {{"in_plane_order", scene.skin.order}, {"thickness", to_string(scene.skin.scheme)}};
  if (stacked) {
    j["thickness_layers"] = layers;
  } else {
    j["composite_order"] = scene.skin.composite_order;
  }
  j["damper"] = to_string(scene.time.damper);
  j["time"] =
      "one implicit step per substep; a step that fails is bisected, then started from softened contacts";
  const int passes = scene.time.lag_passes;
  const bool rubs = std::any_of(scene.colliders.begin(), scene.colliders.end(), [](const ColliderScene& c) {
    return c.friction && c.friction->coefficient > 0;
  });
  if (!rubs)
    j["friction"] = "none";
  else if (scene.time.lag == FrictionLag::extrapolated)
    j["friction"] = "normal force and tangent plane extrapolated from the two previous converged steps";
  else if (passes == 1)
    j["friction"] = "normal force and tangent plane lagged from the previous converged step";
  else
    j["friction"] = "normal force and tangent plane lagged from the pass before, " + std::to_string(passes) +
                    " passes a step";
  j["minimiser"] = scene.solver.minimiser;
  j["kernels"] = skin_kernel_isa();
  return j;
}

ordered_json sizes(const SceneModel& scene_model) {
  const ModelSize size = model_size(scene_model);
  ordered_json points = ordered_json::object();
  for (const TermSize& t : size.terms)
    points[t.name] = {{"points", t.points}, {"points_per_element", t.points_per_element}};
  return {{"faces", size.faces},       {"nodes", size.nodes},
          {"unknowns", size.unknowns}, {"matrix_entries", size.matrix_entries},
          {"history", size.history},   {"quadrature", points}};
}

}  // namespace

RunRecord::RunRecord(std::string path, const SceneModel& scene_model, const VerbContext& context)
    : path_(std::move(path)), frames_(scene_model.scene().time.frames) {
  const BuildInfo build = build_info();
  const BlasInfo blas = blas_info();
  fixed_["program"] = {{"name", context.program.name},
                       {"version", build.version},
                       {"build", build.build_type},
                       {"compiler", build.compiler},
                       {"blas", blas.config.empty() ? blas.name : blas.config}};
  fixed_["command"] = {{"file", context.options.file},
                       {"set", context.options.settings},
                       {"threads", context.options.threads}};
  fixed_["schemes"] = schemes(scene_model.scene());
  fixed_["sizes"] = sizes(scene_model);
  ordered_json features = ordered_json::object();
  for (const FeatureNote& n : scene_model.features()) features[n.feature] = n.present;
  fixed_["features"] = features;
  fixed_["warnings"] = scene_warnings(scene_model.scene());
  fixed_["scene"] = scene_to_json(scene_model.scene());
}

void RunRecord::add(const StepRecord& step) {
  const MinimiserReport& report = step.report;
  ++steps_;
  iterations_ += report.iterations;
  evaluations_ += report.evaluations;
  factorisations_ += report.factorisations;
  bisected_ += step.bisections > 0 ? 1 : 0;
  softened_ += step.softened ? 1 : 0;
}

void RunRecord::write(const std::string& status, const std::string& reason) const {
  ordered_json j = {{"exit", {{"status", status}, {"reason", reason}}}};
  j["progress"] = {{"frames_done", frames_done}, {"frames", frames_}};
  if (resumed_from > 0) j["progress"]["resumed_from_frame"] = resumed_from;
  // Of this process; a resumed run counts from where it was resumed.
  j["work"] = {{"steps", steps_},
               {"iterations", iterations_},
               {"evaluations", evaluations_},
               {"factorisations", factorisations_},
               {"bisected_steps", bisected_},
               {"softened_steps", softened_}};
  j["timings_s"] = {{"setup", setup_seconds},
                    {"solve", solve_seconds},
                    {"solve_cpu", solve_cpu_seconds},
                    {"output", output_seconds}};
  j["resident_MB"] = std::round(resident_memory_mb());
  j.update(fixed_);
  write_file(path_, j.dump(2) + "\n");
}

std::string recorded_status(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) return "";
  const auto record = nlohmann::json::parse(read_file(path), nullptr, false);
  const nlohmann::json::json_pointer status("/exit/status");
  return record.is_object() && record.contains(status) && record[status].is_string()
             ? record[status].get<std::string>()
             : "";
}

}  // namespace rhytid::tools
