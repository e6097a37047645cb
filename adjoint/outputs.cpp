#include "adjoint/outputs.h"

#include "sim/core/error.h"

namespace rhytid::adjoint {

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

}  // namespace rhytid::adjoint
