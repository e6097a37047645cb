#include "sim/output/wrinkles.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "sim/core/error.h"

namespace rhytid {
namespace {

constexpr double kReach = 4;             // of the Gaussian, in standard deviations
constexpr double kSignThreshold = 0.02;  // of the largest |height|: below it a height has no sign

/// Gaussian weights at distances 0, spacing, 2 spacing, ...
std::vector<double> weights(double deviation, double spacing) {
  std::vector<double> w;
  for (int k = 0; k * spacing <= kReach * deviation; ++k)
    w.push_back(std::exp(-0.5 * std::pow(k * spacing / deviation, 2)));
  return w;
}

/// Value at each point of the straight line fitted around it.
VectorXd smooth(const VectorXd& h, double deviation, double spacing) {
  const std::vector<double> w = weights(deviation, spacing);
  const int n = static_cast<int>(h.size()), reach = static_cast<int>(w.size()) - 1;
  VectorXd out(n);
  for (int i = 0; i < n; ++i) {
    double s0 = 0, s1 = 0, s2 = 0, m0 = 0, m1 = 0;
    for (int j = std::max(0, i - reach); j <= std::min(n - 1, i + reach); ++j) {
      const double d = j - i, weight = w[std::abs(j - i)];
      s0 += weight, s1 += weight * d, s2 += weight * d * d;
      m0 += weight * h[j], m1 += weight * d * h[j];
    }
    const double det = s0 * s2 - s1 * s1;
    out[i] = det > 1e-12 * s0 * s0 ? (s2 * m0 - s1 * m1) / det : m0 / s0;
  }
  return out;
}

/// Value at each point of the plane fitted around it.
MatrixXd smooth(const MatrixXd& h, double deviation, double spacing) {
  const std::vector<double> w = weights(deviation, spacing);
  const int nx = static_cast<int>(h.rows()), ny = static_cast<int>(h.cols());
  const int reach = static_cast<int>(w.size()) - 1;
  MatrixXd out = MatrixXd::Constant(nx, ny, std::numeric_limits<double>::quiet_NaN());
  for (int y = 0; y < ny; ++y)
    for (int x = 0; x < nx; ++x) {
      if (std::isnan(h(x, y))) continue;
      Mat3 moments = Mat3::Zero();
      Vec3 right = Vec3::Zero();
      for (int j = std::max(0, y - reach); j <= std::min(ny - 1, y + reach); ++j)
        for (int i = std::max(0, x - reach); i <= std::min(nx - 1, x + reach); ++i) {
          if (std::isnan(h(i, j))) continue;
          const double weight = w[std::abs(i - x)] * w[std::abs(j - y)];
          const Vec3 p(1, i - x, j - y);
          moments += weight * p * p.transpose();
          right += weight * h(i, j) * p;
        }
      // Too few neighbours for a plane: their mean.
      out(x, y) = moments.determinant() > 1e-12 * std::pow(moments(0, 0), 3)
                      ? Vec3(moments.ldlt().solve(right))[0]
                      : right[0] / moments(0, 0);
    }
  return out;
}

/// Adds factor times the transpose of `smooth` (of lines: one column) applied to the weights.
void add_smooth_transpose(const MatrixXd& weights, double deviation, double spacing, double factor,
                          MatrixXd& out) {
  const std::vector<double> w = ::rhytid::weights(deviation, spacing);
  const int nx = static_cast<int>(weights.rows()), ny = static_cast<int>(weights.cols());
  const int reach = static_cast<int>(w.size()) - 1;
  for (int y = 0; y < ny; ++y)
    for (int x = 0; x < nx; ++x) {
      if (std::isnan(weights(x, y)) || weights(x, y) == 0) continue;
      const auto for_neighbours = [&](auto&& visit) {
        for (int j = std::max(0, y - reach); j <= std::min(ny - 1, y + reach); ++j)
          for (int i = std::max(0, x - reach); i <= std::min(nx - 1, x + reach); ++i)
            if (!std::isnan(weights(i, j)))
              visit(i, j, w[std::abs(i - x)] * w[std::abs(j - y)], Vec3(1, i - x, j - y));
      };
      Mat3 moments = Mat3::Zero();
      for_neighbours([&](int, int, double weight, const Vec3& p) { moments += weight * p * p.transpose(); });
      // Value = fit · Σ weight h p: of a plane, of a straight line when there is but one column, or the mean.
      Vec3 fit(1 / moments(0, 0), 0, 0);
      const double s0 = moments(0, 0), det = s0 * moments(1, 1) - moments(1, 0) * moments(1, 0);
      if (ny == 1) {
        if (det > 1e-12 * s0 * s0) fit = Vec3(moments(1, 1), -moments(1, 0), 0) / det;
      } else if (moments.determinant() > 1e-12 * std::pow(s0, 3)) {
        fit = moments.ldlt().solve(Vec3::UnitX());
      }
      const double value = factor * weights(x, y);
      for_neighbours(
          [&](int i, int j, double weight, const Vec3& p) { out(i, j) += value * weight * fit.dot(p); });
    }
}

/// From the two points on either side, of fourth order: waves of ten points keep their slope within 1 %.
double derivative(double b2, double b1, double a1, double a2, double spacing) {
  return (8 * (a1 - b1) - (a2 - b2)) / (12 * spacing);
}

template <class Heights>
Heights pass(const Heights& h, double spacing, const WrinkleBand& band) {
  band.validate();
  require(spacing > 0, "band_pass: the spacing must be positive");
  Heights out = h;
  if (band.shortest > 0) out = smooth(h, half_pass_deviation(band.shortest), spacing);
  if (std::isfinite(band.longest)) out -= smooth(h, half_pass_deviation(band.longest), spacing);
  return out;
}

}  // namespace

void WrinkleBand::validate() const {
  require(shortest >= 0 && longest > shortest, "WrinkleBand: 0 <= shortest < longest");
}

double half_pass_deviation(double wavelength) {
  return wavelength * std::sqrt(2 * std::numbers::ln2) / (2 * std::numbers::pi);
}

VectorXd band_pass(const VectorXd& heights, double spacing, const WrinkleBand& band) {
  require(heights.allFinite(), "band_pass: a line of finite heights");
  return pass(heights, spacing, band);
}
MatrixXd band_pass(const MatrixXd& heights, double spacing, const WrinkleBand& band) {
  return pass(heights, spacing, band);
}

WrinkleSums wrinkle_sums(const VectorXd& b, double spacing) {
  require(b.allFinite(), "wrinkle_sums: a line of finite heights");
  WrinkleSums sums;
  for (Eigen::Index i = 2; i + 2 < b.size(); ++i) {
    const double square = b[i] * b[i], slope = derivative(b[i - 2], b[i - 1], b[i + 1], b[i + 2], spacing);
    sums.square += square * spacing;
    sums.fourth += square * square * spacing;
    sums.gradient(0, 0) += slope * slope * spacing;
  }
  return sums;
}

WrinkleSums wrinkle_sums(const MatrixXd& b, double spacing) {
  WrinkleSums sums;
  const double area = spacing * spacing;
  for (Eigen::Index j = 2; j + 2 < b.cols(); ++j)
    for (Eigen::Index i = 2; i + 2 < b.rows(); ++i) {
      const Eigen::Vector2d slope(derivative(b(i - 2, j), b(i - 1, j), b(i + 1, j), b(i + 2, j), spacing),
                                  derivative(b(i, j - 2), b(i, j - 1), b(i, j + 1), b(i, j + 2), spacing));
      if (std::isnan(b(i, j)) || !slope.allFinite()) continue;
      const double square = b(i, j) * b(i, j);
      sums.square += square * area;
      sums.fourth += square * square * area;
      sums.gradient += area * slope * slope.transpose();
    }
  return sums;
}

MatrixXd wrinkle_sums_transpose(const MatrixXd& b, double spacing, const WrinkleSums& bar) {
  const bool is_line = b.cols() == 1;
  const double measure = is_line ? spacing : spacing * spacing;
  MatrixXd out = b.unaryExpr([](double x) { return std::isnan(x) ? x : 0.0; });
  // The weights of `derivative` over the points −2, −1, 1, 2.
  constexpr int offsets[] = {-2, -1, 1, 2};
  const double stencil[] = {1 / (12 * spacing), -8 / (12 * spacing), 8 / (12 * spacing), -1 / (12 * spacing)};
  const Eigen::Index inset = is_line ? 0 : 2;
  for (Eigen::Index j = inset; j + inset < b.cols(); ++j)
    for (Eigen::Index i = 2; i + 2 < b.rows(); ++i) {
      Eigen::Vector2d slope(derivative(b(i - 2, j), b(i - 1, j), b(i + 1, j), b(i + 2, j), spacing), 0);
      if (!is_line) slope[1] = derivative(b(i, j - 2), b(i, j - 1), b(i, j + 1), b(i, j + 2), spacing);
      const double height = b(i, j);
      if (std::isnan(height) || !slope.allFinite()) continue;
      out(i, j) += measure * (2 * height * bar.square + 4 * height * height * height * bar.fourth);
      const Eigen::Vector2d slope_bar = measure * (bar.gradient + bar.gradient.transpose()) * slope;
      for (int k = 0; k < 4; ++k) {
        out(i + offsets[k], j) += slope_bar[0] * stencil[k];
        if (!is_line) out(i, j + offsets[k]) += slope_bar[1] * stencil[k];
      }
    }
  return out;
}

MatrixXd band_pass_transpose(const MatrixXd& weights, double spacing, const WrinkleBand& band) {
  band.validate();
  require(spacing > 0, "band_pass_transpose: the spacing must be positive");
  MatrixXd out = weights.unaryExpr([](double x) { return std::isnan(x) ? x : 0.0; });
  if (band.shortest > 0)
    add_smooth_transpose(weights, half_pass_deviation(band.shortest), spacing, 1, out);
  else
    out = weights;
  if (std::isfinite(band.longest))
    add_smooth_transpose(weights, half_pass_deviation(band.longest), spacing, -1, out);
  return out;
}

WrinkleDescriptors describe(const WrinkleSums& sums) {
  WrinkleDescriptors d;
  const double steepness = sums.gradient.trace();
  if (!(sums.square > 0) || !(sums.fourth > 0) || !(steepness > 0)) return d;
  const double amplitude = std::sqrt(4. / 3 * sums.fourth / sums.square);
  const double slope = amplitude * std::sqrt(steepness / sums.square);
  if (amplitude < least_wrinkle_height || slope < least_wrinkle_slope) return d;
  d.amplitude = amplitude;
  d.wavelength = 2 * std::numbers::pi * std::sqrt(sums.square / steepness);
  d.extent = 1.5 * sums.square * sums.square / sums.fourth;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(sums.gradient);
  const Eigen::Vector2d main = axes.eigenvectors().col(1);
  d.direction = std::atan2(main[1], main[0]);
  if (d.direction <= -0.5 * std::numbers::pi) d.direction += std::numbers::pi;
  if (d.direction > 0.5 * std::numbers::pi) d.direction -= std::numbers::pi;
  d.coherence = (axes.eigenvalues()[1] - axes.eigenvalues()[0]) / steepness;
  return d;
}

WrinkleCount count_wrinkles(const VectorXd& h, double spacing, double prominence) {
  require(spacing > 0 && prominence >= 0, "count_wrinkles: spacing > 0 and prominence >= 0");
  require(h.allFinite(), "count_wrinkles: a line of finite heights");
  WrinkleCount count;
  const int n = static_cast<int>(h.size());
  if (n < 3) return count;
  const double range = h.maxCoeff() - h.minCoeff();
  count.largest = 0.5 * range;
  if (count.largest < least_wrinkle_height) return count;

  // A crest is confirmed once the profile has fallen by the wanted rise; valleys likewise.
  const double rise = prominence * range;
  int first = -1, last = -1, top = 0;
  double low = h[0];
  bool rising = false;
  for (int i = 1; i < n; ++i) {
    if (!rising) {
      low = std::min(low, h[i]);
      if (h[i] >= low + rise) rising = true, top = i;
    } else if (h[i] > h[top]) {
      top = i;
    } else if (h[i] <= h[top] - rise) {
      ++count.crests;
      if (first < 0) first = top;
      last = top;
      rising = false, low = h[i];
    }
  }
  if (count.crests > 1) count.crest_spacing = (last - first) * spacing / (count.crests - 1);

  const double threshold = kSignThreshold * h.cwiseAbs().maxCoeff();
  int sign = 0;
  for (int i = 0; i < n; ++i) {
    const int here = h[i] > threshold ? 1 : h[i] < -threshold ? -1 : 0;
    if (here == 0) continue;
    if (sign != 0 && here != sign) ++count.sign_changes;
    sign = here;
  }
  return count;
}

}  // namespace rhytid
