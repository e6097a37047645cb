// Where a camera sees material points of the skin, frame by frame: the prediction that tracks are compared
// with.
//   pixel = project(X(u, v) + Σ_a P_a(u, v) u_a)
// Tests: tests/fitting/registration_test.cpp
#pragma once

#include <vector>

#include "adjoint/outputs.h"
#include "fitting/cameras.h"

namespace rhytid::fitting {

/// Pixels of chosen points in chosen frames, each point as one camera sees it; values are [x0 y0 x1 y1 ...] in the order of the frame's list.
class ProjectedPoints final : public adjoint::Output {
 public:
  /// `points_in_frame[f]` lists indices of `points` wanted in frame f; frames beyond the list want none.
  /// Throws ContractError on indices out of range.
  ProjectedPoints(const SkinMesh& mesh, const std::vector<adjoint::MaterialPoint>& points, Camera camera,
                  std::vector<std::vector<int>> points_in_frame);
  /// The same with several cameras: `camera_of_point` [points] indexes them.
  ProjectedPoints(const SkinMesh& mesh, std::vector<adjoint::MaterialPoint> points,
                  std::vector<Camera> cameras, std::vector<int> camera_of_point,
                  std::vector<std::vector<int>> points_in_frame);

  /// Poses of a camera by frame, from the first on: one that moves about the skin. Frames beyond the list
  /// have the last. Throws ContractError for no such camera and for an empty list.
  void set_poses(int camera, std::vector<Camera> by_frame);

  int size(int frame) const override;
  /// px; NaN for a point behind the camera.
  VectorXd values(int frame, const State& state) const override;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const override;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const override;

  const adjoint::PointInterpolation& interpolation() const { return interpolation_; }
  const std::vector<Camera>& cameras() const { return cameras_; }
  /// The list given for a frame; empty beyond.
  const std::vector<int>& points_in(int frame) const;

 private:
  const Camera& camera_of(int point, int frame) const;

  adjoint::PointInterpolation interpolation_;
  std::vector<Camera> cameras_;
  std::vector<std::vector<Camera>> poses_;  ///< per camera by frame; empty where it stands still
  std::vector<int> camera_of_point_;
  std::vector<std::vector<int>> points_in_frame_;
};

}  // namespace rhytid::fitting
