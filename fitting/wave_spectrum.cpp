#include "fitting/wave_spectrum.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

constexpr int kDirections = 4, kSmooth = 6;
/// Points for each unknown of one wave beside the quadratic.
constexpr std::size_t kLeastPoints = std::size_t{3} * (kSmooth + 2);

/// 1, x, y, x², xy, y², in units of the extent.
MatrixXd smooth_part(const MatrixXd& x) {
  const double scale = std::max(1e-12, x.cwiseAbs().maxCoeff());
  const VectorXd u = x.col(0) / scale, v = x.col(1) / scale;
  MatrixXd basis(x.rows(), kSmooth);
  basis << VectorXd::Ones(x.rows()), u, v, u.cwiseAbs2(), u.cwiseProduct(v), v.cwiseAbs2();
  return basis;
}

/// [waves] |a|² + |b|² of coefficients [2 waves][2].
VectorXd powers(const MatrixXd& coefficients) {
  VectorXd power(coefficients.rows() / 2);
  for (Eigen::Index k = 0; k < power.size(); ++k) power[k] = coefficients.middleRows<2>(2 * k).squaredNorm();
  return power;
}

/// Median over the points of the distance to the nearest that the same camera sees; 0 for fewer than two.
double usual_distance(const std::vector<WavePoint>& points) {
  std::vector<double> nearest;
  for (std::size_t i = 0; i < points.size(); ++i) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < points.size(); ++j)
      if (j != i && points[j].camera == points[i].camera)
        least = std::min(least, (points[j].rest - points[i].rest).squaredNorm());
    if (std::isfinite(least)) nearest.push_back(std::sqrt(least));
  }
  if (nearest.empty()) return 0;
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2);
  std::nth_element(nearest.begin(), middle, nearest.end());
  return *middle;
}

}  // namespace

WaveSpectrum::WaveSpectrum(const std::vector<WavePoint>& points, const WaveBand& band)
    : tolerance_(band.tolerance) {
  if (!(band.shortest > 0 && band.shortest < band.longest))
    throw InputError("fit: /fit/waves",
                     "from " + std::to_string(band.shortest) + " to " + std::to_string(band.longest) + " mm",
                     "0 < shortest < longest");
  // Shorter waves alias between the points, and their number grows without bound.
  if (const double least = 2 * usual_distance(points); band.shortest < least)
    throw InputError(
        "fit: /fit/waves/shortest", std::to_string(band.shortest) + " mm",
        "at least " + std::to_string(least) + " mm, twice the distance of a usual track to its nearest");
  Vec3 mean = Vec3::Zero();
  for (const WavePoint& p : points)
    mean += p.rest / static_cast<double>(std::max<std::size_t>(1, points.size()));
  Mat3 scatter = Mat3::Zero();
  for (const WavePoint& p : points) scatter += (p.rest - mean) * (p.rest - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(scatter);
  plane_ << eigen.eigenvectors().col(2), eigen.eigenvectors().col(1);
  for (int a = 0; a < 2; ++a) {  // a sign that does not hang on rounding
    Eigen::Index largest = 0;
    plane_.col(a).cwiseAbs().maxCoeff(&largest);
    if (plane_(largest, a) < 0) plane_.col(a) *= -1;
  }
  std::map<std::pair<int, int>, Block> blocks;
  for (std::size_t i = 0; i < points.size(); ++i) {
    sizes_.push_back(points[i].moved.size());
    for (std::size_t j = 0; j < points[i].frames.size(); ++j) {
      Block& block = blocks[{points[i].camera, points[i].frames[j]}];
      block.camera = points[i].camera, block.frame = points[i].frames[j];
      block.points.push_back({i, static_cast<int>(j)});
    }
  }
  for (auto& [key, block] : blocks)
    if (block.points.size() >= kLeastPoints) add_block(points, band, std::move(block));
  if (size_ == 0)
    throw InputError(
        "fit: /fit/waves", "no frame that tells a wave in the band",
        "at least " + std::to_string(kLeastPoints) +
            " tracks in a frame, over more than the longest wave, nearer to each other than half of the "
            "shortest");
}

void WaveSpectrum::add_block(const std::vector<WavePoint>& points, const WaveBand& band, Block block) {
  const auto n = static_cast<Eigen::Index>(block.points.size());
  MatrixXd x(n, 2);
  block.moved.resize(n, 2);
  double variance = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& [point, j] = block.points[static_cast<std::size_t>(i)];
    x.row(i) = (plane_.transpose() * points[point].rest).transpose();
    block.moved.row(i) = points[point].moved.segment<2>(Eigen::Index{2} * j).transpose();
    variance += points[point].variances[static_cast<std::size_t>(j)] / static_cast<double>(n);
  }
  x.rowwise() -= x.colwise().mean().eval();
  const MatrixXd basis = smooth_part(x);
  const MatrixXd smooth =
      Eigen::HouseholderQR<MatrixXd>(basis).householderQ() * MatrixXd::Identity(n, kSmooth);
  std::vector<Vec2> waves;
  std::vector<MatrixXd> rows;
  std::vector<double> noise;
  for (int d = 0; d < kDirections; ++d) {
    const double angle = d * std::numbers::pi / kDirections;
    const Vec2 along(std::cos(angle), std::sin(angle));
    const VectorXd s = x * along;
    const double extent = s.maxCoeff() - s.minCoeff();
    for (double number = std::max(1 / band.longest, 1 / std::max(1e-12, extent));
         number <= 1 / band.shortest * (1 + 1e-9); number += 1 / extent) {
      const Vec2 k = 2 * std::numbers::pi * number * along;
      const VectorXd phase = x * k;
      MatrixXd pair(n, 2);
      pair << phase.array().cos(), phase.array().sin();
      pair -= smooth * (smooth.transpose() * pair);
      const Eigen::Matrix2d inner = pair.transpose() * pair;
      // Half of n where the wave is one: below a tenth of it the points cannot tell it from the quadratic.
      if (Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(inner).eigenvalues()[0] <
          0.05 * static_cast<double>(n))
        continue;
      const Eigen::Matrix2d inverse = inner.inverse();
      waves.push_back(k);
      rows.emplace_back(inverse * pair.transpose());
      noise.push_back(std::sqrt(variance * inverse.trace() / 2));
    }
  }
  if (waves.empty()) return;
  const auto m = static_cast<Eigen::Index>(waves.size());
  block.waves.resize(m, 2);
  block.coefficients.resize(2 * m, n);
  block.noise.resize(m);
  for (Eigen::Index k = 0; k < m; ++k) {
    block.waves.row(k) = waves[static_cast<std::size_t>(k)].transpose();
    block.coefficients.middleRows<2>(2 * k) = rows[static_cast<std::size_t>(k)];
    block.noise[k] = noise[static_cast<std::size_t>(k)];
  }
  const VectorXd squares = block.noise.cwiseAbs2();
  block.power = (powers(block.coefficients * block.moved) - 4 * squares).cwiseMax(0.0);
  block.tracked = (block.power + squares).cwiseSqrt();
  size_ += static_cast<int>(m);
  blocks_.push_back(std::move(block));
}

MatrixXd WaveSpectrum::moved_by_prediction(const Block& block,
                                           const std::vector<VectorXd>& differences) const {
  MatrixXd moved = block.moved;
  for (Eigen::Index i = 0; i < moved.rows(); ++i) {
    const auto& [point, j] = block.points[static_cast<std::size_t>(i)];
    moved.row(i) -= differences[point].segment<2>(Eigen::Index{2} * j).transpose();
  }
  return moved;
}

VectorXd WaveSpectrum::residuals(const std::vector<VectorXd>& differences) const {
  VectorXd out(size_);
  Eigen::Index row = 0;
  for (const Block& b : blocks_) {
    const VectorXd power = powers(b.coefficients * moved_by_prediction(b, differences));
    for (Eigen::Index k = 0; k < power.size(); ++k)
      out[row++] = (b.tracked[k] - std::sqrt(power[k] + b.noise[k] * b.noise[k])) /
                   std::hypot(b.noise[k], tolerance_ * b.tracked[k]);
  }
  return out;
}

MatrixXd WaveSpectrum::jacobian(const std::vector<VectorXd>& differences,
                                const std::vector<MatrixXd>& dr) const {
  const Eigen::Index columns = dr.empty() ? 0 : dr.front().cols();
  MatrixXd out(size_, columns);
  Eigen::Index row = 0;
  for (const Block& b : blocks_) {
    const MatrixXd c = b.coefficients * moved_by_prediction(b, differences);
    const Eigen::Index n = b.moved.rows(), m = b.noise.size();
    MatrixXd dx(n, columns), dy(n, columns);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto& [point, j] = b.points[static_cast<std::size_t>(i)];
      dx.row(i) = -dr[point].row(Eigen::Index{2} * j);
      dy.row(i) = -dr[point].row(Eigen::Index{2} * j + 1);
    }
    const MatrixXd cx = b.coefficients * dx, cy = b.coefficients * dy;
    for (Eigen::Index k = 0; k < m; ++k) {
      const double s = std::sqrt(c.middleRows<2>(2 * k).squaredNorm() + b.noise[k] * b.noise[k]);
      out.row(row++) = -(c(2 * k, 0) * cx.row(2 * k) + c(2 * k, 1) * cy.row(2 * k) +
                         c(2 * k + 1, 0) * cx.row(2 * k + 1) + c(2 * k + 1, 1) * cy.row(2 * k + 1)) /
                       (s * std::hypot(b.noise[k], tolerance_ * b.tracked[k]));
    }
  }
  return out;
}

std::vector<VectorXd> WaveSpectrum::gradient(const std::vector<VectorXd>& differences) const {
  std::vector<VectorXd> out;
  for (const Eigen::Index size : sizes_) out.push_back(VectorXd::Zero(size));
  const VectorXd z = residuals(differences);
  Eigen::Index row = 0;
  for (const Block& b : blocks_) {
    MatrixXd c = b.coefficients * moved_by_prediction(b, differences);
    for (Eigen::Index k = 0; k < b.noise.size(); ++k, ++row) {
      const double s = std::sqrt(c.middleRows<2>(2 * k).squaredNorm() + b.noise[k] * b.noise[k]);
      c.middleRows<2>(2 * k) *= -z[row] / (s * std::hypot(b.noise[k], tolerance_ * b.tracked[k]));
    }
    const MatrixXd by_moved =
        b.coefficients.transpose() * c;  // of what is predicted; differences have the other sign
    for (Eigen::Index i = 0; i < by_moved.rows(); ++i) {
      const auto& [point, j] = b.points[static_cast<std::size_t>(i)];
      out[point].segment<2>(Eigen::Index{2} * j) -= by_moved.row(i).transpose();
    }
  }
  return out;
}

WaveDescription WaveSpectrum::described(const Block& block, const VectorXd& power, bool with_sigma) const {
  WaveDescription out{.frame = block.frame, .camera = block.camera};
  const double sum = power.sum();
  if (!(sum > 0)) return out;
  out.amplitude = std::sqrt(sum);
  const VectorXd number = block.waves.rowwise().norm();
  const double mean = power.dot(number) / sum;
  out.wavelength = 2 * std::numbers::pi / mean;
  double cosine = 0, sine = 0;  // of the doubled angle
  std::vector<double> doubled;
  for (Eigen::Index k = 0; k < power.size(); ++k) {
    doubled.push_back(2 * std::atan2(block.waves(k, 1), block.waves(k, 0)));
    cosine += power[k] * std::cos(doubled.back()), sine += power[k] * std::sin(doubled.back());
  }
  out.direction = std::atan2(sine, cosine) / 2;
  if (!with_sigma) return out;
  const double strength = cosine * cosine + sine * sine;
  double amplitude = 0, length = 0, direction = 0;
  for (Eigen::Index k = 0; k < power.size(); ++k) {
    // Of a power P: 2 √P σ, and where there is none what noise makes of it.
    const double sigma = 2 * std::sqrt(power[k] + block.noise[k] * block.noise[k]) * block.noise[k];
    const double angle = doubled[static_cast<std::size_t>(k)];
    amplitude += std::pow(sigma / (2 * out.amplitude), 2);
    length += std::pow(sigma * (number[k] - mean) / sum * out.wavelength / mean, 2);
    if (strength > 0)
      direction += std::pow(sigma * (std::sin(angle) * cosine - std::cos(angle) * sine) / (2 * strength), 2);
  }
  out.amplitude_sigma = std::sqrt(amplitude);
  out.wavelength_sigma = std::sqrt(length);
  out.direction_sigma = std::sqrt(direction);
  return out;
}

std::vector<WaveDescription> WaveSpectrum::tracked() const {
  std::vector<WaveDescription> out;
  for (const Block& b : blocks_) out.push_back(described(b, b.power, true));
  return out;
}

std::vector<WaveDescription> WaveSpectrum::predicted(const std::vector<VectorXd>& differences) const {
  std::vector<WaveDescription> out;
  for (const Block& b : blocks_)
    out.push_back(described(b, powers(b.coefficients * moved_by_prediction(b, differences)), false));
  return out;
}

}  // namespace rhytid::fitting
