#include "adjoint/surface_response.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <array>
#include <cmath>

#include "adjoint/directions.h"
#include "sim/core/error.h"
#include "sim/element/basis.h"

namespace rhytid::adjoint {

VectorXd column_areas(const SkinMesh& mesh, bool outer) {
  const TriangleBasis basis(mesh.order);
  const int level = outer ? mesh.num_levels - 1 : 0;
  VectorXd areas = VectorXd::Zero(mesh.num_columns);
  for (int f = 0; f < mesh.num_faces; ++f) {
    const int* columns = mesh.face_columns.data() + static_cast<std::size_t>(f) * mesh.nodes_per_face();
    for (const auto& triangle : basis.subtriangles()) {
      std::array<int, 3> c;
      for (int k = 0; k < 3; ++k) c[k] = columns[triangle[k]];
      const auto corner = [&](int k) -> Vec3 { return mesh.rest.row(mesh.node(c[k], level)).transpose(); };
      const double area = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
      for (const int column : c) areas[column] += area / 3;
    }
  }
  return areas;
}

OuterDisplacements::OuterDisplacements(const SkinMesh& mesh, int first_frame)
    : num_columns_(mesh.num_columns), num_levels_(mesh.num_levels), first_frame_(first_frame) {}

VectorXd OuterDisplacements::values(int frame, const State& state) const {
  return tangent(frame, state, state.u, MatrixXd());  // linear
}

MatrixXd OuterDisplacements::tangent(int frame, const State&, const MatrixXd& du, const MatrixXd&) const {
  MatrixXd rows(size(frame), du.cols());
  for (int c = 0; 3 * c < rows.rows(); ++c)
    rows.middleRows<3>(3 * c) = du.middleRows<3>(3 * ((c + 1) * num_levels_ - 1));
  return rows;
}

void OuterDisplacements::adjoint(int, const State&, const VectorXd& weights, VectorXd& u_bar,
                                 VectorXd&) const {
  for (int c = 0; 3 * c < weights.size(); ++c)
    u_bar.segment<3>(3 * ((c + 1) * num_levels_ - 1)) += weights.segment<3>(3 * c);
}

MeanSquareDisplacement::MeanSquareDisplacement(const SkinMesh& mesh, int first_frame)
    : weights_(column_areas(mesh, true)), num_levels_(mesh.num_levels), first_frame_(first_frame) {
  weights_ /= weights_.sum();
}

VectorXd MeanSquareDisplacement::values(int frame, const State& state) const {
  VectorXd mean = VectorXd::Zero(size(frame));
  for (int c = 0; mean.size() > 0 && c < weights_.size(); ++c)
    mean[0] += weights_[c] * state.u.segment<3>(3 * ((c + 1) * num_levels_ - 1)).squaredNorm();
  return mean;
}

MatrixXd MeanSquareDisplacement::tangent(int frame, const State& state, const MatrixXd& du,
                                         const MatrixXd&) const {
  MatrixXd row = MatrixXd::Zero(size(frame), du.cols());
  for (int c = 0; row.size() > 0 && c < weights_.size(); ++c) {
    const int at = 3 * ((c + 1) * num_levels_ - 1);
    row += 2 * weights_[c] * state.u.segment<3>(at).transpose() * du.middleRows<3>(at);
  }
  return row;
}

void MeanSquareDisplacement::adjoint(int, const State& state, const VectorXd& weights, VectorXd& u_bar,
                                     VectorXd&) const {
  for (int c = 0; weights.size() > 0 && c < weights_.size(); ++c) {
    const int at = 3 * ((c + 1) * num_levels_ - 1);
    u_bar.segment<3>(at) += 2 * weights[0] * weights_[c] * state.u.segment<3>(at);
  }
}

SurfaceResponse surface_response(const SkinMesh& mesh, const TangentResult& tangent,
                                 const std::optional<Vec3>& view) {
  require(tangent.frames.size() > 1, "surface_response: a run of one frame at least");
  const Eigen::Index n = tangent.frames.back().cols(), columns = mesh.num_columns;
  const VectorXd areas = column_areas(mesh, true);
  const VectorXd root_weights = (areas / areas.sum()).cwiseSqrt();
  const auto frames = static_cast<Eigen::Index>(tangent.frames.size()) - 1;
  SurfaceResponse r;
  r.largest = VectorXd::Zero(n);
  r.rms_of_frame = MatrixXd::Zero(frames, n);
  r.last = MatrixXd::Zero(columns, n);
  const Mat3 seen =
      view ? Mat3(Mat3::Identity() - view->stableNormalized() * view->stableNormalized().transpose())
           : Mat3(Mat3::Identity());
  for (Eigen::Index f = 1; f <= frames; ++f) {
    require(tangent.frames[f].rows() == 3 * columns, "surface_response: not a tangent of OuterDisplacements");
    MatrixXd du = tangent.frames[f];
    for (Eigen::Index c = 0; c < columns; ++c) {
      r.last.row(c) = du.middleRows<3>(3 * c).colwise().norm();  // of frame f: overwritten by later ones
      r.largest = r.largest.cwiseMax(r.last.row(c).transpose());
      du.middleRows<3>(3 * c) *= root_weights[c];
    }
    r.rms_of_frame.row(f - 1) = du.colwise().norm();
    for (Eigen::Index c = 0; view && c < columns; ++c)
      du.middleRows<3>(3 * c) = seen * du.middleRows<3>(3 * c).eval();
    r.root = stacked_root(r.root, du);
  }
  r.rms = (r.rms_of_frame.colwise().squaredNorm() / static_cast<double>(frames)).cwiseSqrt().transpose();
  return r;
}

VectorXd gauge_direction(const Model& model) {
  VectorXd gauge = VectorXd::Zero(model.native.size());
  for (const NativeBlock& block : model.native_blocks)
    for (const int i : block.stiffness_like) gauge[i] = model.native[i];
  return gauge;
}

std::optional<VectorXd> gauge_coordinates(const Model& model, const MatrixXd& jacobian) {
  const VectorXd gauge = gauge_direction(model);
  if (jacobian.cols() == 0 || !(gauge.norm() > 0)) return std::nullopt;
  // Rows are measured in units of their own native value, for moduli of all sizes to count alike.
  VectorXd unit = VectorXd::Ones(gauge.size());
  for (Eigen::Index i = 0; i < gauge.size(); ++i)
    if (gauge[i] != 0) unit[i] = 1 / std::fabs(gauge[i]);
  const MatrixXd scaled = unit.asDiagonal() * jacobian;
  const VectorXd wanted = unit.cwiseProduct(gauge);
  VectorXd x = scaled.completeOrthogonalDecomposition().solve(wanted);
  if ((scaled * x - wanted).norm() > 1e-9 * wanted.norm()) return std::nullopt;
  return x;
}

}  // namespace rhytid::adjoint
