#include "tools/render/truth.h"

#include <algorithm>
#include <cmath>

#include "sim/scene/load.h"
#include "sim/scene/names.h"
#include "sim/scene/parameter.h"

namespace rhytid::tools {

using fitting::Observation;
using fitting::TrackStatus;

TruthTracker::TruthTracker(const MovingSurface& surface, const SubdividedSurface& tessellation,
                           const fitting::Camera& camera, int spacing_px)
    : surface_(surface), tessellation_(tessellation), camera_(camera), spacing_px_(spacing_px) {}

void TruthTracker::add_frame(int frame, const std::vector<Finger>& fingers) {
  const SurfaceView view(surface_, tessellation_, camera_, frame);
  if (frame == 0) {
    for (int y = spacing_px_ / 2; y < camera_.height; y += spacing_px_)
      for (int x = spacing_px_ / 2; x < camera_.width; x += spacing_px_) {
        const auto point = view.pick(Vec2(x, y));
        if (!point) continue;
        points_.push_back(*point);
        fitting::Track& track = tracks_.tracks.emplace_back();
        track.id = static_cast<int>(points_.size()) - 1;
        track.camera = camera_.name;
      }
  }
  const Vec3 eye = camera_.centre();
  for (size_t i = 0; i < points_.size(); ++i) {
    Observation o{.frame = frame, .time_s = surface_.times[static_cast<size_t>(frame)]};
    const Vec3 x = surface_.position(points_[i], frame);
    const Vec2 pixel = camera_.project(x);
    const bool is_covered = std::any_of(fingers.begin(), fingers.end(), [&](const Finger& finger) {
      const auto s = finger.hit(eye, x - eye);
      return s && *s < 1;
    });
    const bool is_inside = pixel.allFinite() && pixel.x() >= -0.5 && pixel.y() >= -0.5 &&
                           pixel.x() <= camera_.width - 0.5 && pixel.y() <= camera_.height - 0.5;
    if (!is_inside) {
      o.status = TrackStatus::outside;
    } else if (is_covered || view.is_hidden(points_[i])) {
      o.status = TrackStatus::occluded;
    } else {
      o.status = TrackStatus::ok;
      o.pixel = pixel;
      o.covariance = truth_sigma_px * truth_sigma_px * Eigen::Matrix2d::Identity();
      o.correlation = 1;
    }
    tracks_.tracks[i].observations.push_back(o);
  }
}

nlohmann::json truth_record(const Scene& fit, const SceneModel& truth, int stride, int frames) {
  using nlohmann::json;
  const Scene& scene = truth.scene();
  const std::vector<ParameterSpec> known = all_parameters(scene);
  json parameters = json::array();
  for (const ParameterSpec& spec : all_parameters(fit)) {
    const auto same = std::find_if(known.begin(), known.end(),
                                   [&spec](const ParameterSpec& k) { return k.address == spec.address; });
    if (same == known.end()) continue;
    parameters.push_back({{"address", spec.address},
                          {"name", spec.name},
                          {"unit", spec.unit},
                          {"value", get_parameter(scene, spec.address)}});
  }
  const SkinMesh& mesh = truth.model().mesh;
  json layers = json::array();
  for (const LayerScene& layer : scene.skin.layers)
    layers.push_back({{"name", layer.name}, {"elements", layer.elements}, {"order", layer.order}});
  const VectorXd at_rest = VectorXd::Zero(3 * mesh.num_nodes());
  const auto unknowns = truth.model().to_unknowns(at_rest).size();
  const int substeps = scene.time.substeps;
  return {{"scene_file", scene.file},
          {"fit_scene_file", fit.file},
          {"parameters", parameters},
          {"discretisation",
           {{"order", scene.skin.order},
            {"thickness_scheme", to_string(scene.skin.scheme)},
            {"layers", layers},
            {"faces", mesh.num_faces},
            {"elements", mesh.num_elements()},
            {"columns", mesh.num_columns},
            {"levels", mesh.num_levels},
            {"nodes", mesh.num_nodes()},
            {"unknowns", unknowns},
            {"frame_rate_hz", scene.time.frame_rate},
            {"substeps", substeps},
            {"dt_s", 1 / (scene.time.frame_rate * substeps)},
            {"damper", to_string(scene.time.damper)}}},
          {"footage",
           {{"frames", frames}, {"frame_rate_hz", scene.time.frame_rate / stride}, {"stride", stride}}},
          {"scene", scene_to_json(scene)}};
}

}  // namespace rhytid::tools
