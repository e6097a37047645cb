#include "sim/scene/scene_model.h"

#include "sim/core/error.h"
#include "sim/scene/parameter.h"
#include "sim/scene/parts/base_part.h"
#include "sim/scene/parts/clock_part.h"
#include "sim/scene/parts/collider_part.h"
#include "sim/scene/parts/ligament_part.h"
#include "sim/scene/parts/rim.h"
#include "sim/scene/parts/skin_part.h"

namespace rhytid {

namespace {

/// Whether a held part is away from its rest position at time 0 of its path: the rest shape is then no
/// equilibrium. Where the clock runs ahead, that does not change with it, nor may it while that is fitted.
bool is_moved_at_start(const Model& model) {
  const VectorXd given = model.given_displacement(0);
  return given.size() > 0 && given.cwiseAbs().maxCoeff() > 0;
}

}  // namespace

SceneModel::SceneModel(Scene scene) : scene_(std::move(scene)) {
  model_.mesh = build_skin_mesh(scene_);
  parts_.push_back(std::make_shared<SkinPart>(scene_));
  if (scene_.ligaments) {
    ligaments_ = std::make_shared<LigamentPart>(scene_, model_.mesh);
    parts_.push_back(ligaments_);
  } else {
    features_.push_back({"ligaments", false, "no /ligaments in the scene"});
  }
  if (scene_.base) {
    parts_.push_back(std::make_shared<BasePart>());
  } else {
    features_.push_back({"base contact", false, "no /base in the scene"});
  }
  parts_.push_back(std::make_shared<ColliderPart>(scene_));
  parts_.push_back(std::make_shared<ClockPart>());

  for (const auto& part : parts_) part->add_native_blocks(scene_, model_);
  const NativeBlock& last = model_.native_blocks.back();
  model_.native.resize(last.offset + last.size);
  for (const auto& part : parts_) part->add_terms(scene_, model_, features_);
  model_.constraints = skin_constraints(model_.mesh, scene_.skin, scene_.file);
  if (!scene_.skin.held.empty())
    features_.push_back(
        {"held parts", true,
         std::to_string(scene_.skin.held.size()) + " parts, of these " +
             std::to_string(model_.constraints.moved.size()) + " moved" +
             (is_moved_at_start(model_) ? "; frame 0 is the relaxed equilibrium there" : "")});
  if (scene_.skin.rim == RimCondition::sliding)
    features_.push_back({"sliding rim", true,
                         std::to_string(model_.mesh.rim_columns.size()) + " columns, of these " +
                             std::to_string(rim_corners(model_.mesh).size()) + " corners held in the plane"});
  model_.native = native(scene_);
  model_.finish();
}

RunOptions SceneModel::run_options() const {
  RunOptions o;
  o.frame_rate = scene_.time.frame_rate;
  o.frames = scene_.time.frames;
  o.substeps = scene_.time.substeps;
  o.settle = scene_.skin.pre_stretch.has_value() || is_moved_at_start(model_);
  o.lag_passes = scene_.time.lag_passes;
  o.max_bisections = scene_.time.max_bisections;
  MinimiserOptions& m = o.minimiser;
  for (const Minimiser method :
       {Minimiser::newton, Minimiser::newton_projected, Minimiser::lbfgs, Minimiser::lbfgs_literal})
    if (scene_.solver.minimiser == name(method)) m.method = method;
  m.relative_tolerance = scene_.solver.relative_tolerance;
  m.absolute_tolerance = scene_.solver.absolute_tolerance;
  m.max_iterations = scene_.solver.max_iterations;
  m.lbfgs_memory = scene_.solver.lbfgs_memory;
  m.lbfgs_refresh = scene_.solver.lbfgs_refresh;
  for (const FactorPrecision precision :
       {FactorPrecision::automatic, FactorPrecision::full, FactorPrecision::mixed})
    if (scene_.solver.factor_precision == name(precision)) m.precision = precision;
  return o;
}

VectorXd SceneModel::native(const Scene& scene) const {
  VectorXd values = VectorXd::Zero(model_.native.size());
  for (const auto& part : parts_) part->set_native(scene, model_, values);
  return values;
}

VectorXd SceneModel::native_derivative(const Scene& scene, const std::string& address) const {
  const ParameterSpec spec =
      describe_parameter(scene, address);  // canonical, by names; refuses unknown addresses
  VectorXd derivative = VectorXd::Zero(model_.native.size());
  for (const auto& part : parts_)
    if (part->add_derivative(scene, model_, spec.address, derivative)) return derivative;
  throw InputError(scene.file + ": " + address, "a parameter without a derivative",
                   "one of the fit-able parameters");
}

bool SceneModel::is_smooth_in(const std::string& address, const Trajectory& run) const {
  // A Taylor test of an offset in units of 0.25 s begins with half a millisecond and needs a few halvings.
  constexpr double kRoom = 1e-4;  // s
  if (address != "/time/offset" || run.steps.empty()) return true;
  std::vector<double> times;
  for (const StepRecord& record : run.steps) times.push_back(record.step.t);
  // Where the first step starts only matters to slip under a pressure, which a second pass brings there.
  if (!run.steps.front().earlier_passes.empty()) times.push_back(run.steps.front().step.t_old);
  return !model_.clock_meets_kink(model_.native, times, kRoom);
}

VectorXd SceneModel::ligament_map(const Scene& scene) const {
  return ligaments_ && scene.ligaments ? ligaments_->map(scene) : VectorXd();
}

const std::vector<Vec3>& SceneModel::source_positions() const {
  static const std::vector<Vec3> none;
  return ligaments_ ? ligaments_->source_positions() : none;
}

const std::vector<std::array<int, 3>>& SceneModel::column_triangles() const {
  static const std::vector<std::array<int, 3>> none;
  return ligaments_ ? ligaments_->column_triangles() : none;
}

}  // namespace rhytid
