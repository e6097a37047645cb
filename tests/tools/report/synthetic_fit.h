// A fit that was never run, but whose files agree with each other: a small scene, a camera, footage of noise
// with marks, and residuals about the simulated motion. Seeded.
#pragma once

#include <Eigen/Eigenvalues>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>

#include "fitting/cameras.h"
#include "fitting/fit_result.h"
#include "sim/output/atomic_file.h"
#include "sim/output/camera.h"
#include "sim/output/surface_tessellation.h"
#include "sim/scene/load.h"
#include "sim/scene/parameter.h"
#include "sim/scene/scene_model.h"
#include "sim/time/simulate.h"
#include "tests/support/small_scenes.h"
#include "tools/render/footage.h"

namespace rhytid::test {

inline fitting::FittedParameter fitted(const std::string& address, const std::string& name,
                                       const std::string& unit, double initial, double value, double sigma,
                                       double truth) {
  fitting::FittedParameter p;
  p.address = address, p.name = name, p.unit = unit, p.transform = "log";
  p.initial = initial, p.value = value, p.sigma = sigma, p.truth = truth;
  p.lower = truth / 20, p.upper = truth * 20;
  p.low95 = value * std::exp(-1.96 * sigma), p.high95 = value * std::exp(1.96 * sigma);
  return p;
}

/// Writes scene, camera, footage and fit into `folder`; `frames` of the scene.
inline fitting::FitResult write_synthetic_fit(const std::string& folder, int frames) {
  namespace fs = std::filesystem;
  fs::remove_all(folder);
  fs::create_directories(folder);
  const auto in_folder = [&](const char* name) { return (fs::path(folder) / name).string(); };
  write_file(in_folder("scene.json"), drag_scene(2, frames));

  fitting::FitResult fit;
  fit.case_name = "drag <twin> & \"marks\"";
  fit.optimiser = "ceres";
  fit.status = "converged";
  fit.converged = true;
  fit.scene_file = in_folder("scene.json");
  fit.camera_file = in_folder("camera.yaml");
  fit.footage_file = in_folder("footage.avi");
  fit.tracks_file = in_folder("tracks.csv");
  fit.gauge = "The modulus of layer soft was held at 20 kPa: displacements alone do not fix a common scale.";
  fit.parameters = {
      fitted("/skin/layers/film/youngs_modulus", "film youngs_modulus", "MPa", 2, 1.013, 0.02, 1),
      fitted("/ligaments/sources/left/strength", "left strength", "1/mm", 1.5, 0.47, 0.11, 0.5),
      fitted("/ligaments/sources/right/strength", "right strength", "1/mm", 1.5, 3.31, 0.04, 3),
      fitted("/colliders/finger/friction/coefficient", "finger coefficient", "", 0.6, 0.398, 0.008, 0.4)};
  fit.derived = {{"film to soft modulus", "", 50.65, 48.7, 52.7, 50.}};
  fit.cannot_tell = {"the relaxation time of layer soft: the footage is too short <for it>"};
  fit.notes = {"Huber loss at 3 standard deviations", "tracks: seed 1"};

  // A correlation and its singular values that belong together: J = U S Vᵀ with covariance V S⁻² Vᵀ.
  const int n = 4;
  MatrixXd c = MatrixXd::Identity(n, n);
  c(0, 1) = c(1, 0) = -0.31, c(1, 2) = c(2, 1) = -0.86, c(0, 3) = c(3, 0) = 0.42;
  fit.correlation = c;
  VectorXd sigma(n);
  for (int k = 0; k < n; ++k) sigma[k] = fit.parameters[static_cast<size_t>(k)].sigma;
  const MatrixXd covariance = sigma.asDiagonal() * c * sigma.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance);
  fit.singular_values = eigen.eigenvalues().cwiseSqrt().cwiseInverse();
  fit.right_vectors = eigen.eigenvectors();

  for (int i = 0; i < 9; ++i) {
    const double rest = std::exp(-0.9 * i);
    fitting::FitIteration step{i, 1 + i, 210 + 9e4 * rest * rest, 4e3 * rest, 0.5 * rest, 2.1 * i, {}};
    for (const auto& p : fit.parameters) step.values.push_back(p.value * std::pow(p.initial / p.value, rest));
    fit.history.push_back(step);
  }
  fit.further_views = {{"the same once more", {0.71, 0.71, 0.71, 0.71}},
                       {"another camera 45° up", {0.62, std::nan(""), 0.4, 0.9}}};
  fit.measured = {{0, 1, "force_finger_z", -0.11, 0.005, -0.108},
                  {0, 2, "force_finger_z", -0.14, 0.005, -0.139}};
  fit.systematic = {
      {"thickness", "layers stacked", "", 0.05, 3.1, {0.01, -0.02, 0.005, 0.001}},
      {"plane", "order 4 in the plane instead of 3", "", 0.11, 5.2, {0.012, 0.09, -0.01, 0.002}},
      {"steps", "4 steps per frame instead of 2", "did not converge in frame 3", 0, 0, {}}};
  fit.misfit = {"Residuals are 1.1 times what the tracks' noise says."};
  fit.initial_cost = fit.history.front().cost, fit.final_cost = fit.history.back().cost;
  fit.forward_runs = 11, fit.jacobian_runs = 9, fit.seconds = 83, fit.forward_seconds = 4.2;
  fit.frames = frames, fit.reduced_chi_square = 1.21;

  fit.fitted_scene = load_scene(fit.scene_file);
  fit.fitted_scene_file = "fitted_scene.json";
  for (const auto& p : fit.parameters) set_parameter(*fit.fitted_scene, p.address, p.value);
  const SceneModel model(load_scene(fit.scene_file));
  const SkinMesh& mesh = model.model().mesh;
  const PinholeCamera view = look_at({1, -16, 26}, {1, 0, 1}, Vec3::UnitY(), 320, 240, 34);
  fitting::Camera camera;
  camera.intrinsics = view.K, camera.rotation = view.R, camera.translation = view.t;
  camera.width = view.width, camera.height = view.height;
  fitting::write_camera(camera, fit.camera_file);

  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const SubdividedSurface surface(mesh, SurfaceSide::outer, 2);
  const Trajectory run = simulate(model.model(), model.native(), model.run_options());
  tools::FootageWriter footage(fit.footage_file, "mjpg", 24, camera.width, camera.height);
  double squares = 0;
  for (int frame = 0; frame <= frames; ++frame) {
    Image image(camera.width, camera.height, 3, 150);
    const MatrixX3 positions = surface.positions(run.at_frame(frame).u);
    for (int v = 0; v < surface.num_vertices(); ++v) {
      if (surface.welded()[static_cast<size_t>(v)] != v) continue;
      const Vec2 seen = camera.project(positions.row(v).transpose());
      const int x = static_cast<int>(std::lround(seen.x())), y = static_cast<int>(std::lround(seen.y()));
      image.fill(x - 1, y - 1, x + 2, y + 2, {90, 40, 30});
      if (frame == 0) continue;
      fitting::FitResidual r{
          frame, v, seen.x() + 0.1 * normal(random), seen.y() + 0.1 * normal(random), seen.x(), seen.y(), 1};
      if (v == 22) r.x_px += 1.5, r.weight = 0.2;  // one feature that slipped
      squares += std::pow(r.x_px - seen.x(), 2) + std::pow(r.y_px - seen.y(), 2);
      fit.residuals.push_back(r);
    }
    footage.add(image);
  }
  footage.commit();
  fit.num_observations = static_cast<int>(fit.residuals.size());
  fit.num_tracks = fit.num_observations / frames;
  fit.rms_px = std::sqrt(squares / fit.num_observations);
  fitting::write_fit_result(fit, folder);
  return fit;
}

}  // namespace rhytid::test
