#include "sim/surface/heat_map.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "sim/core/error.h"
#include "sim/core/work_count.h"
#include "sim/surface/heat_operator.h"
#include "sim/surface/m_matrix_factor.h"

namespace rhytid {
namespace {

// Below this, the parts of φ that are 1e-16 of it are no longer normal numbers and the quotient loses digits.
constexpr double kSmallestMagnitude = 1e-290;

/// θ_s at every node that carries mass, shape [num_nodes][num_sources].
MatrixXd source_kernels(const MatrixX3& nodes, const VectorXd& mass, const std::vector<HeatSource>& sources,
                        std::vector<int>* unresolved) {
  MatrixXd theta = MatrixXd::Zero(nodes.rows(), static_cast<Eigen::Index>(sources.size()));
  for (std::size_t s = 0; s < sources.size(); ++s) {
    const auto column = static_cast<Eigen::Index>(s);
    Eigen::Index nearest = -1;
    double nearest_d2 = 0;
    bool resolved = false;
    for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
      if (mass[i] <= 0) continue;
      const double d2 = (nodes.row(i).transpose() - sources[s].position).squaredNorm();
      if (nearest < 0 || d2 < nearest_d2) nearest = i, nearest_d2 = d2;
      const double u = 1 - d2 / (sources[s].radius * sources[s].radius);
      if (u <= 0) continue;
      theta(i, column) = u * u * u * u;
      resolved = true;
    }
    if (resolved) continue;
    theta(nearest, column) = 1;
    unresolved->push_back(static_cast<int>(s));
  }
  return theta;
}

Eigen::Index nearest_source(const Vec3& x, const std::vector<HeatSource>& sources) {
  const auto closer = [&x](const HeatSource& a, const HeatSource& b) {
    return (a.position - x).squaredNorm() < (b.position - x).squaredNorm();
  };
  return std::min_element(sources.begin(), sources.end(), closer) - sources.begin();
}

}  // namespace

namespace {
WorkCount maps_solved;
}

long heat_maps_solved() {
  return maps_solved;
}

namespace {

/// G and what it came from.
struct Diffused {
  HeatOperator op;
  MatrixXd theta;
  double scale;  // both sides of the equation are divided by max(1, t): nothing overflows, whatever the time
  VectorXd mass;
  std::unique_ptr<MMatrixFactor> factor;
  MatrixXd kernel;
};

Diffused diffuse(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                 const std::vector<HeatSource>& sources, double time, std::vector<int>* unresolved) {
  require(!sources.empty(), "diffuse_sources: at least one source is needed");
  require(time >= 0 && std::isfinite(time), "diffuse_sources: time must be finite and >= 0");
  require(nodes.allFinite(), "diffuse_sources: nodes must be finite");
  for (const HeatSource& source : sources) {
    require(source.position.allFinite(), "diffuse_sources: source position must be finite");
    require(std::isfinite(source.radius) && source.radius > 0, "diffuse_sources: radius must be > 0");
  }
  ++maps_solved;
  Diffused d;
  d.op = assemble_heat_operator(nodes, triangles);
  d.theta = source_kernels(nodes, d.op.mass, sources, unresolved);
  d.scale = 1 / std::max(1.0, time);
  d.mass = d.scale * d.op.mass;
  std::vector<WeightedEdge> edges;
  if (time > 0)
    for (const WeightedEdge& e : d.op.edges)
      if (const double w = e.weight * (time * d.scale); w > 0) edges.push_back({e.i, e.j, w});
  d.factor = std::make_unique<MMatrixFactor>(d.mass, edges);
  d.kernel = d.factor->solve(d.mass.asDiagonal() * d.theta);
  return d;
}

}  // namespace

MatrixXd source_motion(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                       const std::vector<HeatSource>& sources, double time, int source) {
  require(source >= 0 && source < static_cast<int>(sources.size()), "source_motion: no such source");
  std::vector<int> unresolved;
  const Diffused d = diffuse(nodes, triangles, sources, time, &unresolved);
  MatrixXd motion = MatrixXd::Zero(nodes.rows(), 3);
  if (std::find(unresolved.begin(), unresolved.end(), source) != unresolved.end()) return motion;
  // θ = q⁴, q = 1 − |x − p|²/h²
  const HeatSource& moved = sources[static_cast<std::size_t>(source)];
  for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
    const Vec3 way = nodes.row(i).transpose() - moved.position;
    const double h2 = moved.radius * moved.radius, q = 1 - way.squaredNorm() / h2;
    if (q > 0 && d.mass[i] > 0) motion.row(i) = (4 * q * q * q * 2 / h2) * way.transpose();
  }
  motion = d.factor->solve(d.mass.asDiagonal() * motion);
  for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
    const double magnitude = d.kernel.row(i).sum();  // φ
    if (magnitude < kSmallestMagnitude)
      motion.row(i).setZero();
    else
      motion.row(i) /= magnitude;
  }
  return motion;
}

HeatMapWeights diffuse_sources(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                               const std::vector<HeatSource>& sources, double time) {
  HeatMapWeights result;
  const Diffused d = diffuse(nodes, triangles, sources, time, &result.unresolved_sources);
  const auto& [op, theta, scale, mass, held_factor, kernel] = d;
  const MMatrixFactor& factor = *held_factor;

  // Ġ: right-hand side −L G. Outside the source's own kernel L G = −M G / t, which has no cancellation.
  MatrixXd rate = MatrixXd::Zero(kernel.rows(), kernel.cols());
  for (const WeightedEdge& e : op.edges) {
    rate.row(e.i) -= (scale * e.weight) * (kernel.row(e.i) - kernel.row(e.j));
    rate.row(e.j) -= (scale * e.weight) * (kernel.row(e.j) - kernel.row(e.i));
  }
  if (time > 0)
    for (Eigen::Index s = 0; s < rate.cols(); ++s)
      for (Eigen::Index i = 0; i < rate.rows(); ++i)
        if (theta(i, s) == 0) rate(i, s) = mass[i] / time * kernel(i, s);
  const MatrixXd kernel_rate = factor.solve(rate);

  result.weights = MatrixXd::Zero(kernel.rows(), kernel.cols());
  result.d_weights_d_time = MatrixXd::Zero(kernel.rows(), kernel.cols());
  for (Eigen::Index i = 0; i < kernel.rows(); ++i) {
    const double magnitude = kernel.row(i).sum();  // φ
    if (magnitude < kSmallestMagnitude) {
      result.weights(i, nearest_source(nodes.row(i).transpose(), sources)) = 1;
      ++result.num_unreached;
      continue;
    }
    result.weights.row(i) = kernel.row(i) / magnitude;
    // ẇ_s = Σ_r (w_r Ġ_s − w_s Ġ_r) / φ: by pairs, so that where one source rules its large Ġ/φ does not
    // drown the small rates of the others, and each row sums to zero.
    for (Eigen::Index s = 0; s < kernel.cols(); ++s)
      for (Eigen::Index r = 0; r < s; ++r) {
        const double exchange = result.weights(i, r) * (kernel_rate(i, s) / magnitude) -
                                result.weights(i, s) * (kernel_rate(i, r) / magnitude);
        result.d_weights_d_time(i, s) += exchange;
        result.d_weights_d_time(i, r) -= exchange;
      }
  }
  return result;
}

}  // namespace rhytid
