#include "sim/solve/negative_curvature.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <vector>

namespace rhytid {

std::optional<NegativeCurvature> find_negative_curvature(const BlockMatrix& raw,
                                                         const CholeskyFactor& projected,
                                                         const VectorXd& start, int max_steps) {
  // Basis v_k, P-orthonormal, with w_k = P v_k kept beside it so that P itself is not needed.
  std::vector<VectorXd> v, w;
  std::vector<double> diagonal, off_diagonal;
  VectorXd next_w = start, next_v = projected.solve(start);
  double norm = std::sqrt(next_v.dot(next_w));
  if (!(norm > 0) || !std::isfinite(norm)) return std::nullopt;
  VectorXd ritz;
  double lowest = 0;
  for (int k = 0; k < max_steps; ++k) {
    v.push_back(next_v / norm);
    w.push_back(next_w / norm);
    next_w = raw.multiply(v.back());
    next_v = projected.solve(next_w);
    diagonal.push_back(v.back().dot(next_w));
    // Full reorthogonalisation, twice: the basis is short.
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t i = 0; i < v.size(); ++i) {
        const double overlap = next_v.dot(w[i]);
        next_v -= overlap * v[i];
        next_w -= overlap * w[i];
      }
    }
    Eigen::SelfAdjointEigenSolver<MatrixXd> eigen;
    eigen.computeFromTridiagonal(Eigen::Map<const VectorXd>(diagonal.data(), k + 1),
                                 Eigen::Map<const VectorXd>(off_diagonal.data(), k));
    lowest = eigen.eigenvalues()[0];
    ritz = eigen.eigenvectors().col(0);
    norm = std::sqrt(std::max(0.0, next_v.dot(next_w)));
    const double error = norm * std::abs(ritz[k]);
    if (!(norm > 1e-12) || (lowest < 0 && error < 1e-2 * -lowest)) break;
    off_diagonal.push_back(norm);
  }
  if (!(lowest < -1e-10)) return std::nullopt;
  NegativeCurvature result{VectorXd::Zero(start.size()), lowest};
  for (std::size_t i = 0; i < v.size(); ++i) result.direction += ritz[static_cast<Eigen::Index>(i)] * v[i];
  return result;
}

}  // namespace rhytid
