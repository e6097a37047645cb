#include "fitting/spatial_misfit.h"

#include <algorithm>
#include <cmath>

#include "sim/core/error.h"

namespace rhytid::fitting {

MatrixXd spatial_score_covariance(const MatrixXd& scores, const std::vector<Vec2>& pixels) {
  const auto count = static_cast<std::size_t>(scores.cols());
  require(count == pixels.size(), "spatial_score_covariance: one pixel per track");
  MatrixXd sum = MatrixXd::Zero(scores.rows(), scores.rows());
  if (count == 0) return sum;
  Vec2 low = pixels[0], high = pixels[0];
  for (const Vec2& p : pixels) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vec2 width = (high - low) / kMisfitPatches;
  if (!(width.minCoeff() > 0)) return sum;
  for (std::size_t i = 0; i < count; ++i) {
    VectorXd neighbours = VectorXd::Zero(scores.rows());
    for (std::size_t j = 0; j < count; ++j) {
      const Vec2 apart = (pixels[i] - pixels[j]).cwiseAbs().cwiseQuotient(width);
      const double weight = std::max(0.0, 1 - apart.x()) * std::max(0.0, 1 - apart.y());
      if (weight > 0) neighbours += weight * scores.col(static_cast<Eigen::Index>(j));
    }
    sum += scores.col(static_cast<Eigen::Index>(i)) * neighbours.transpose();
  }
  constexpr double patches = kMisfitPatches * kMisfitPatches;
  return 0.5 * patches / (patches - 1) * (sum + sum.transpose());
}

}  // namespace rhytid::fitting
