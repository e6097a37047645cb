// Names for the small fixed-size arrays that cross module borders.
#pragma once

#include <Eigen/Core>

namespace rhytid {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using VectorXd = Eigen::VectorXd;
using MatrixXd = Eigen::MatrixXd;
/// One row per point, x y z; row-major so that row(i) is contiguous. Shape [num_points][3].
using MatrixX3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

}  // namespace rhytid
