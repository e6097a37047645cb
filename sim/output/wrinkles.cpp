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

/// Visits every point of `mask` around (x, y) that is on the surface with its coefficient c in the value there of the
/// plane that is fitted to the heights h, weighted by a Gaussian: value = Σ c h. Of a straight line when there is
/// but one column; too few neighbours for either give their mean.
template <class Visit>
void for_local_fit(const MatrixXd& mask, const std::vector<double>& w, int x, int y, Visit&& visit) {
  const int nx = static_cast<int>(mask.rows()), ny = static_cast<int>(mask.cols());
  const int reach = static_cast<int>(w.size()) - 1;
  const auto for_neighbours = [&](auto&& each) {
    for (int j = std::max(0, y - reach); j <= std::min(ny - 1, y + reach); ++j)
      for (int i = std::max(0, x - reach); i <= std::min(nx - 1, x + reach); ++i)
        if (!std::isnan(mask(i, j)))
          each(i, j, w[std::abs(i - x)] * w[std::abs(j - y)], Vec3(1, i - x, j - y));
  };
  Mat3 moments = Mat3::Zero();
  for_neighbours([&](int, int, double weight, const Vec3& p) { moments += weight * p * p.transpose(); });
  const double s0 = moments(0, 0), det = s0 * moments(1, 1) - moments(1, 0) * moments(1, 0);
  Vec3 fit(1 / s0, 0, 0);
  if (ny == 1) {
    if (det > 1e-12 * s0 * s0) fit = Vec3(moments(1, 1), -moments(1, 0), 0) / det;
  } else if (moments.determinant() > 1e-12 * std::pow(s0, 3)) {
    fit = moments.ldlt().solve(Vec3::UnitX());
  }
  for_neighbours([&](int i, int j, double weight, const Vec3& p) { visit(i, j, weight * fit.dot(p)); });
}

/// Value at each point of the plane (line) fitted around it, NaN beside the surface.
MatrixXd smooth(const MatrixXd& h, double deviation, double spacing) {
  const std::vector<double> w = weights(deviation, spacing);
  MatrixXd out = MatrixXd::Constant(h.rows(), h.cols(), std::numeric_limits<double>::quiet_NaN());
  for (int y = 0; y < h.cols(); ++y)
    for (int x = 0; x < h.rows(); ++x) {
      if (std::isnan(h(x, y))) continue;
      double value = 0;
      for_local_fit(h, w, x, y, [&](int i, int j, double c) { value += c * h(i, j); });
      out(x, y) = value;
    }
  return out;
}

/// Adds factor times the transpose of `smooth` applied to `bars`, NaN beside the surface.
void add_smooth_transpose(const MatrixXd& bars, double deviation, double spacing, double factor,
                          MatrixXd& out) {
  const std::vector<double> w = weights(deviation, spacing);
  for (int y = 0; y < bars.cols(); ++y)
    for (int x = 0; x < bars.rows(); ++x) {
      if (std::isnan(bars(x, y)) || bars(x, y) == 0) continue;
      const double bar = factor * bars(x, y);
      for_local_fit(bars, w, x, y, [&](int i, int j, double c) { out(i, j) += c * bar; });
    }
}

/// From the two points on either side, of fourth order: waves of ten points keep their slope within 1 %.
double derivative(double b2, double b1, double a1, double a2, double spacing) {
  return (8 * (a1 - b1) - (a2 - b2)) / (12 * spacing);
}

MatrixXd pass(const MatrixXd& h, double spacing, const WrinkleBand& band) {
  band.validate();
  require(spacing > 0, "band_pass: the spacing must be positive");
  MatrixXd out = h;
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
  if (b.cols() == 1) return wrinkle_sums(VectorXd(b.col(0)), spacing);
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
