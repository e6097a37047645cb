#include "fitting/projected_points.h"

#include <algorithm>

#include "sim/core/error.h"

namespace rhytid::fitting {

ProjectedPoints::ProjectedPoints(const SkinMesh& mesh, const std::vector<adjoint::MaterialPoint>& points,
                                 Camera camera, std::vector<std::vector<int>> points_in_frame)
    : ProjectedPoints(mesh, points, std::vector<Camera>{std::move(camera)},
                      std::vector<int>(points.size(), 0), std::move(points_in_frame)) {}

ProjectedPoints::ProjectedPoints(const SkinMesh& mesh, std::vector<adjoint::MaterialPoint> points,
                                 std::vector<Camera> cameras, std::vector<int> camera_of_point,
                                 std::vector<std::vector<int>> points_in_frame)
    : interpolation_(mesh, std::move(points)),
      cameras_(std::move(cameras)),
      camera_of_point_(std::move(camera_of_point)),
      points_in_frame_(std::move(points_in_frame)) {
  require(static_cast<int>(camera_of_point_.size()) == interpolation_.num_points(),
          "ProjectedPoints: one camera per point");
  for (const int camera : camera_of_point_)
    require(camera >= 0 && camera < static_cast<int>(cameras_.size()),
            "ProjectedPoints: camera index out of range");
  for (const std::vector<int>& list : points_in_frame_)
    for (const int i : list)
      require(i >= 0 && i < interpolation_.num_points(), "ProjectedPoints: point index out of range");
}

void ProjectedPoints::set_poses(int camera, std::vector<Camera> by_frame) {
  require(camera >= 0 && camera < static_cast<int>(cameras_.size()) && !by_frame.empty(),
          "ProjectedPoints: poses of no camera");
  poses_.resize(cameras_.size());
  poses_[camera] = std::move(by_frame);
}

const Camera& ProjectedPoints::camera_of(int point, int frame) const {
  const std::size_t c = camera_of_point_[point];
  if (c >= poses_.size() || poses_[c].empty()) return cameras_[c];
  return poses_[c][std::min(static_cast<std::size_t>(std::max(frame, 0)), poses_[c].size() - 1)];
}

const std::vector<int>& ProjectedPoints::points_in(int frame) const {
  static const std::vector<int> none;
  return frame >= 0 && frame < static_cast<int>(points_in_frame_.size()) ? points_in_frame_[frame] : none;
}

int ProjectedPoints::size(int frame) const {
  return 2 * static_cast<int>(points_in(frame).size());
}

VectorXd ProjectedPoints::values(int frame, const State& state) const {
  VectorXd out(size(frame));
  Eigen::Index row = 0;
  for (const int i : points_in(frame)) {
    out.segment<2>(row) = camera_of(i, frame).project(interpolation_.position(i, state.u));
    row += 2;
  }
  return out;
}

MatrixXd ProjectedPoints::tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd&) const {
  MatrixXd out(size(frame), du.cols());
  Eigen::Index row = 0;
  for (const int i : points_in(frame)) {
    out.middleRows<2>(row) = camera_of(i, frame).projection_jacobian(interpolation_.position(i, state.u)) *
                             interpolation_.tangent(i, du);
    row += 2;
  }
  return out;
}

void ProjectedPoints::adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
                              VectorXd&) const {
  Eigen::Index row = 0;
  for (const int i : points_in(frame)) {
    const auto jacobian = camera_of(i, frame).projection_jacobian(interpolation_.position(i, state.u));
    interpolation_.adjoint(i, jacobian.transpose() * weights.segment<2>(row), u_bar);
    row += 2;
  }
}

}  // namespace rhytid::fitting
