#include "tools/bench/plain_surface.h"

#include <Eigen/Dense>
#include <cmath>
#include <nanoflann.hpp>
#include <utility>
#include <vector>

namespace rhytid::tools {
namespace {

const double* theta_of(const ElementView& v, int q) {
  return v.theta + q * v.theta_stride;
}

Eigen::VectorXd shape_functions(const ElementView& v, int q) {
  return Eigen::Map<const Eigen::VectorXd>(v.node_by_row + q * v.padded_nodes, v.num_nodes);
}

Vec3 displacement(const Eigen::VectorXd& shape, const double* u) {
  return Eigen::Map<const Eigen::Matrix3Xd>(u, 3, shape.size()) * shape;
}

}  // namespace

PlainSurfaceLaw plain_ligament() {
  return [](const ElementView& v, int q, const Vec3& u) {
    const double *theta = theta_of(v, q), k = theta[0], eps = theta[1], b = theta[2];
    const double r = std::sqrt(u.squaredNorm() + eps * eps), s = r - eps, grown = std::exp(b * s);
    PointResponse p;
    p.energy = k / b * (grown - 1);
    p.traction = k * grown / r * u;
    p.tangent = k * grown * (Mat3::Identity() / r + (b / (r * r) - 1 / (r * r * r)) * u * u.transpose());
    return p;
  };
}

PlainSurfaceLaw plain_sphere_contact(double radius, double onset) {
  return [=](const ElementView& v, int q, const Vec3& u) {
    const double* theta = theta_of(v, q);
    const Vec3 x = u + Eigen::Map<const Vec3>(v.rest + 4 * q) - Eigen::Map<const Vec3>(theta + 2);
    const double length = x.norm(), depth = theta[1] + v.rest[4 * q + 3] - (length - radius);
    PointResponse p;
    if (depth <= 0) return p;
    const double kappa = theta[0], over = depth - onset;
    const bool pressed = depth >= onset;
    p.energy = kappa * (pressed ? onset * onset / 3 + onset * over + over * over
                                : depth * depth * depth / (3 * onset));
    const double slope = kappa * (pressed ? 2 * over + onset : depth * depth / onset);
    const double curvature = kappa * (pressed ? 2 : 2 * depth / onset);
    const Vec3 n = x / length;
    p.traction = -slope * n;
    p.tangent = curvature * n * n.transpose() - slope / length * (Mat3::Identity() - n * n.transpose());
    return p;
  };
}

PlainSurfaceLaw plain_friction(double slip_speed, const double* prepared) {
  return [=](const ElementView& v, int q, const Vec3& u) {
    const double* own = prepared + 7 * q;
    PointResponse p;
    const double strength = theta_of(v, q)[2] * own[0];
    if (strength <= 0) return p;
    const Vec3 n = Eigen::Map<const Vec3>(own + 1);
    const Mat3 tangential = Mat3::Identity() - n * n.transpose();
    const Vec3 slip = tangential * (u - Eigen::Map<const Vec3>(own + 4));
    const double d = slip.norm(), eps = slip_speed * v.dt, e = 1 / eps;
    double quotient = 1 / d, slope = -1 / (d * d * d);  // D'/δ and its derivative over δ
    p.energy = strength * (d - eps / 2);
    if (d < eps) {
      p.energy = strength * (std::pow(d, 6) * std::pow(e, 5) - 3 * std::pow(d, 5) * std::pow(e, 4) +
                             2.5 * std::pow(d, 4) * std::pow(e, 3));
      quotient = e * e * e * d * d * (10 - 15 * e * d + 6 * e * e * d * d);
      slope = e * e * e * (20 - 45 * e * d + 24 * e * e * d * d);
    }
    p.traction = strength * quotient * slip;
    p.tangent = strength * (quotient * tangential + slope * slip * slip.transpose());
    return p;
  };
}

double plain_surface_residual(const PlainSurfaceLaw& law, const ElementView& v, const double* u, double* f) {
  double energy = 0;
  for (int q = 0; q < v.num_points; ++q) {
    const Eigen::VectorXd shape = shape_functions(v, q);
    const PointResponse p = law(v, q, displacement(shape, u));
    energy += v.weight[q] * p.energy;
    Eigen::Map<Eigen::Matrix3Xd>(f, 3, v.num_nodes) += v.weight[q] * p.traction * shape.transpose();
  }
  return energy;
}

void plain_surface_hessian(const PlainSurfaceLaw& law, const ElementView& v, const double* u, double* dense) {
  const int size = 3 * v.num_nodes;
  Eigen::Map<Eigen::MatrixXd> matrix(dense, size, size);
  matrix.setZero();
  for (int q = 0; q < v.num_points; ++q) {
    const Eigen::VectorXd shape = shape_functions(v, q);
    const PointResponse p = law(v, q, displacement(shape, u));
    Eigen::Matrix3Xd n = Eigen::Matrix3Xd::Zero(3, size);
    for (int i = 0; i < v.num_nodes; ++i) n.middleCols<3>(3 * i).diagonal().setConstant(shape[i]);
    matrix.noalias() += n.transpose() * (v.weight[q] * p.tangent * n);
  }
}

struct PlainImls::Tree {
  using Index = nanoflann::KDTreeEigenMatrixAdaptor<MatrixX3, 3>;
  explicit Tree(const MatrixX3& points) : index(3, points) {}
  Index index;
};

PlainImls::PlainImls(const MatrixX3& points, const MatrixX3& normals, double support)
    : points_(points), normals_(normals), support_(support), tree_(std::make_unique<const Tree>(points)) {}
PlainImls::~PlainImls() = default;

GapJet PlainImls::evaluate(const Vec3& x) const {
  // Sums of θ, θ s and their first and second derivatives, then those of the quotient.
  const double h2 = support_ * support_;
  double weight = 0, sum = 0;
  Vec3 weight_slope = Vec3::Zero(), sum_slope = Vec3::Zero();
  Mat3 weight_curvature = Mat3::Zero(), sum_curvature = Mat3::Zero();
  std::vector<std::pair<Eigen::Index, double>> found;
  tree_->index.index->radiusSearch(x.data(), h2, found, {});
  for (const auto& [i, squared] : found) {
    const Vec3 d = x - points_.row(i).transpose(), n = normals_.row(i).transpose();
    const double t = 1 - squared / h2;
    const double theta = std::pow(t, 4), s = n.dot(d);
    const Vec3 slope = -8 / h2 * std::pow(t, 3) * d;
    const Mat3 curvature =
        -8 / h2 * std::pow(t, 3) * Mat3::Identity() + 48 / (h2 * h2) * t * t * d * d.transpose();
    weight += theta;
    weight_slope += slope;
    weight_curvature += curvature;
    sum += theta * s;
    sum_slope += s * slope + theta * n;
    sum_curvature += s * curvature + slope * n.transpose() + n * slope.transpose();
  }
  GapJet jet;
  jet.supported = weight > 0;
  if (!jet.supported) return jet;
  jet.gap = sum / weight;
  jet.gradient = (sum_slope - jet.gap * weight_slope) / weight;
  jet.hessian = (sum_curvature - jet.gap * weight_curvature - jet.gradient * weight_slope.transpose() -
                 weight_slope * jet.gradient.transpose()) /
                weight;
  return jet;
}

}  // namespace rhytid::tools
