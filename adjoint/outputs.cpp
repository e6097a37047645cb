#include "adjoint/outputs.h"

#include "sim/core/error.h"

namespace rhytid::adjoint {

VectorXd Output::step_values(int frame, const StepProblem&, const State& state) const {
  return values(frame, state);
}

MatrixXd Output::step_tangent(int frame, const StepProblem&, const State& state,
                              const StepDirections& directions) const {
  return tangent(frame, state, directions.du, directions.ds);
}

void Output::step_adjoint(int frame, const StepProblem&, const State& state, const VectorXd& weights,
                          StepBars& bars) const {
  adjoint(frame, state, weights, bars.u, bars.s);
}

namespace {
[[noreturn]] void refuse_rest(int frame) {
  throw ContractError("StepOutput: no step led to frame " + std::to_string(frame));
}
}  // namespace

VectorXd StepOutput::values(int frame, const State&) const {
  if (size(frame) > 0) refuse_rest(frame);
  return {};
}

MatrixXd StepOutput::tangent(int frame, const State&, const MatrixXd& du, const MatrixXd&) const {
  if (size(frame) > 0) refuse_rest(frame);
  return MatrixXd(0, du.cols());
}

void StepOutput::adjoint(int frame, const State&, const VectorXd&, VectorXd&, VectorXd&) const {
  if (size(frame) > 0) refuse_rest(frame);
}

PointInterpolation::PointInterpolation(const SkinMesh& mesh, std::vector<MaterialPoint> points)
    : points_(std::move(points)), num_nodes_(mesh.nodes_per_face()), rest_(points_.size(), 3) {
  const TriangleBasis basis(mesh.order);
  weights_.resize(points_.size() * num_nodes_);
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const MaterialPoint& p = points_[k];
    require(p.face >= 0 && p.face < mesh.num_faces, "MaterialPoint: face out of range");
    basis.evaluate(p.u, p.v, weights_.data() + k * num_nodes_, nullptr, nullptr);
    const auto nodes = p.outer ? mesh.outer_nodes(p.face) : mesh.inner_nodes(p.face);
    nodes_.insert(nodes_.end(), nodes.begin(), nodes.end());
    rest_.row(k).setZero();
    for (int i = 0; i < num_nodes_; ++i)
      rest_.row(k) += weights_[k * num_nodes_ + i] * mesh.rest.row(nodes[i]);
  }
}

Vec3 PointInterpolation::displacement(int point, const VectorXd& u) const {
  Vec3 sum = Vec3::Zero();
  const std::size_t at = static_cast<std::size_t>(point) * num_nodes_;
  for (int i = 0; i < num_nodes_; ++i) sum += weights_[at + i] * u.segment<3>(3 * nodes_[at + i]);
  return sum;
}

MatrixXd PointInterpolation::tangent(int point, const MatrixXd& du) const {
  MatrixXd sum = MatrixXd::Zero(3, du.cols());
  const std::size_t at = static_cast<std::size_t>(point) * num_nodes_;
  for (int i = 0; i < num_nodes_; ++i) sum += weights_[at + i] * du.middleRows(3 * nodes_[at + i], 3);
  return sum;
}

void PointInterpolation::adjoint(int point, const Vec3& weight, VectorXd& u_bar) const {
  const std::size_t at = static_cast<std::size_t>(point) * num_nodes_;
  for (int i = 0; i < num_nodes_; ++i) u_bar.segment<3>(3 * nodes_[at + i]) += weights_[at + i] * weight;
}

VectorXd PointPositions::values(int frame, const State& state) const {
  VectorXd out(size(frame));
  if (out.size() == 0) return out;
  for (int k = 0; k < interpolation_.num_points(); ++k)
    out.segment<3>(3 * k) = interpolation_.position(k, state.u);
  return out;
}

MatrixXd PointPositions::tangent(int frame, const State&, const MatrixXd& du, const MatrixXd&) const {
  MatrixXd out(size(frame), du.cols());
  if (out.rows() == 0) return out;
  for (int k = 0; k < interpolation_.num_points(); ++k)
    out.middleRows(3 * k, 3) = interpolation_.tangent(k, du);
  return out;
}

void PointPositions::adjoint(int frame, const State&, const VectorXd& weights, VectorXd& u_bar,
                             VectorXd&) const {
  if (size(frame) == 0) return;
  for (int k = 0; k < interpolation_.num_points(); ++k)
    interpolation_.adjoint(k, weights.segment<3>(3 * k), u_bar);
}

MeanNormalDisplacement::MeanNormalDisplacement(const SkinMesh& mesh, std::vector<MaterialPoint> points,
                                               int first_frame)
    : interpolation_(mesh, std::move(points)),
      normals_(MatrixX3::Zero(interpolation_.num_points(), 3)),
      first_frame_(first_frame) {
  const int n = mesh.nodes_per_face(), count = interpolation_.num_points();
  const TriangleBasis basis(mesh.order);
  std::vector<double> weights(n);
  for (int k = 0; k < count; ++k) {
    const MaterialPoint& p = interpolation_.points()[k];
    basis.evaluate(p.u, p.v, weights.data(), nullptr, nullptr);
    for (int i = 0; i < n; ++i)
      normals_.row(k) +=
          weights[i] * mesh.column_normals.row(mesh.face_columns[static_cast<std::size_t>(p.face) * n + i]);
    normals_.row(k) /= normals_.row(k).norm() * count;
  }
}

VectorXd MeanNormalDisplacement::values(int frame, const State& state) const {
  VectorXd out = VectorXd::Zero(size(frame));
  if (out.size() == 0) return out;
  for (int k = 0; k < interpolation_.num_points(); ++k)
    out[0] += normals_.row(k).dot(interpolation_.displacement(k, state.u));
  return out;
}

MatrixXd MeanNormalDisplacement::tangent(int frame, const State&, const MatrixXd& du, const MatrixXd&) const {
  MatrixXd out = MatrixXd::Zero(size(frame), du.cols());
  if (out.rows() == 0) return out;
  for (int k = 0; k < interpolation_.num_points(); ++k)
    out.row(0) += normals_.row(k) * interpolation_.tangent(k, du);
  return out;
}

void MeanNormalDisplacement::adjoint(int frame, const State&, const VectorXd& weights, VectorXd& u_bar,
                                     VectorXd&) const {
  if (size(frame) == 0) return;
  for (int k = 0; k < interpolation_.num_points(); ++k)
    interpolation_.adjoint(k, weights[0] * normals_.row(k).transpose(), u_bar);
}

int CombinedOutput::size(int frame) const {
  int sum = 0;
  for (const auto& part : parts_) sum += part->size(frame);
  return sum;
}

template <class Visit>
void CombinedOutput::for_parts(int frame, Visit&& visit) const {
  Eigen::Index at = 0;
  for (const auto& part : parts_) {
    const Eigen::Index count = part->size(frame);
    if (count > 0) visit(*part, at, count);
    at += count;
  }
}

VectorXd CombinedOutput::values(int frame, const State& state) const {
  VectorXd out(size(frame));
  for_parts(frame, [&](const Output& part, Eigen::Index at, Eigen::Index count) {
    out.segment(at, count) = part.values(frame, state);
  });
  return out;
}

MatrixXd CombinedOutput::tangent(int frame, const State& state, const MatrixXd& du,
                                 const MatrixXd& ds) const {
  MatrixXd out(size(frame), du.cols());
  for_parts(frame, [&](const Output& part, Eigen::Index at, Eigen::Index count) {
    out.middleRows(at, count) = part.tangent(frame, state, du, ds);
  });
  return out;
}

void CombinedOutput::adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
                             VectorXd& s_bar) const {
  for_parts(frame, [&](const Output& part, Eigen::Index at, Eigen::Index count) {
    part.adjoint(frame, state, weights.segment(at, count), u_bar, s_bar);
  });
}

VectorXd CombinedOutput::step_values(int frame, const StepProblem& step, const State& state) const {
  VectorXd out(size(frame));
  for_parts(frame, [&](const Output& part, Eigen::Index at, Eigen::Index count) {
    out.segment(at, count) = part.step_values(frame, step, state);
  });
  return out;
}

MatrixXd CombinedOutput::step_tangent(int frame, const StepProblem& step, const State& state,
                                      const StepDirections& directions) const {
  MatrixXd out(size(frame), directions.du.cols());
  for_parts(frame, [&](const Output& part, Eigen::Index at, Eigen::Index count) {
    out.middleRows(at, count) = part.step_tangent(frame, step, state, directions);
  });
  return out;
}

void CombinedOutput::step_adjoint(int frame, const StepProblem& step, const State& state,
                                  const VectorXd& weights, StepBars& bars) const {
  for_parts(frame, [&](const Output& part, Eigen::Index at, Eigen::Index count) {
    part.step_adjoint(frame, step, state, weights.segment(at, count), bars);
  });
}

}  // namespace rhytid::adjoint
