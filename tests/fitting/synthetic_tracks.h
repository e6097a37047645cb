// Tracks made by projecting a simulated run, with seeded noise: they test the machinery of a fit, not the
// model (truth and fit share the discretisation here).
#pragma once

#include <Eigen/Geometry>
#include <random>

#include "fitting/cameras.h"
#include "fitting/fit.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/parameter.h"
#include "sim/scene/scene_model.h"
#include "tests/support/small_scenes.h"

namespace rhytid::fitting::test {

/// Oblique view of the patch around the origin, about 25 px/mm, with lens distortion.
inline Camera make_camera() {
  Camera camera;
  camera.intrinsics << 1500, 0, 320, 0, 1500, 240, 0, 0, 1;
  camera.distortion = {-0.1, 0.05, 1e-3, -5e-4, 0};
  camera.width = 640;
  camera.height = 480;
  const Vec3 centre(5, -20, 56), forward = (Vec3(0, 0, 1) - centre).normalized();
  const Vec3 right = forward.cross(Vec3::UnitZ()).normalized(), down = forward.cross(right);
  camera.rotation << right.transpose(), down.transpose(), forward.transpose();
  camera.translation = -camera.rotation * centre;
  return camera;
}

/// Points of the outer surface seen in all frames 0..n of the scene's run, each pixel with independent
/// Gaussian noise of `sigma` px per axis (frame 0 included). The camera has a pose for every frame, or one.
inline TrackSet make_tracks(const Scene& scene, const std::vector<Camera>& by_frame, int points_per_face,
                            double sigma, unsigned seed) {
  const SceneModel model(scene);
  RunOptions options = model.run_options();
  options.minimiser.polish = true;
  const Trajectory run = simulate(model.model(), model.native(), options);
  require(run.complete, "make_tracks: the run did not complete");
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(0.05, 0.95);
  std::normal_distribution<double> noise(0, sigma);
  std::vector<adjoint::MaterialPoint> points;
  for (int f = 0; f < model.model().mesh.num_faces; ++f)
    for (int k = 0; k < points_per_face; ++k) {
      double u = uniform(rng), v = uniform(rng);
      if (u + v > 1) {
        u = 1 - u;
        v = 1 - v;
      }
      points.push_back({f, u, v, true});
    }
  const adjoint::PointInterpolation at(model.model().mesh, points);
  TrackSet set;
  for (int i = 0; i < at.num_points(); ++i) {
    Track track{i, by_frame[0].name, {}};
    for (int f = 0; f <= run.frames(); ++f) {
      const Camera& camera = by_frame[by_frame.size() > 1 ? f : 0];
      Observation o;
      o.frame = f;
      o.time_s = f / options.frame_rate;
      o.status = TrackStatus::ok;
      o.pixel = camera.project(at.position(i, run.at_frame(f).u)) + Vec2(noise(rng), noise(rng));
      o.covariance = std::max(sigma * sigma, 1e-8) * Eigen::Matrix2d::Identity();
      track.observations.push_back(o);
    }
    set.tracks.push_back(std::move(track));
  }
  return set;
}

inline TrackSet make_tracks(const Scene& scene, const Camera& camera, int points_per_face, double sigma,
                            unsigned seed) {
  return make_tracks(scene, std::vector<Camera>{camera}, points_per_face, sigma, seed);
}

inline Scene drag_scene(int frames, std::vector<std::string> settings = {}) {
  settings.insert(settings.begin(), "/skin/surface/grid/cells=[4, 3]");
  return parse_scene_text(rhytid::test::drag_scene(2, frames), "drag.json", settings);
}

/// A fitted parameter with everything but the start taken from the scene.
inline FitParameter fitted(const std::string& address, std::optional<double> initial = {}) {
  FitParameter parameter;
  parameter.address = address;
  parameter.initial = initial;
  return parameter;
}

/// What the fits of these tests look for; the truth is the scene itself.
inline FitCase three_parameters() {
  FitCase fit;
  fit.min_sigma = 0.005;
  fit.discretisation_check = false;
  fit.consider.emplace();
  fit.parameters = {fitted("/ligaments/sources/right/strength", 1.5),
                    fitted("/skin/layers/film/youngs_modulus", 0.5),
                    fitted("/colliders/finger/friction/coefficient", 0.6)};
  return fit;
}

}  // namespace rhytid::fitting::test
