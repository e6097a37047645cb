#include "fitting/tracking/spline_image.h"

#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

constexpr double kPole = -0.26794919243112270647;  // √3 − 2

/// kPole^24 < 2e-14: a longer start sum would not change a float.
constexpr int kHorizon = 24;

/// Direct cubic B-spline transform of `count` values spaced by `stride`, for `lanes` neighbouring signals at
/// once: causal filter, anticausal filter, gain 6 = (1 − z)(1 − 1/z).
void transform(float* data, int count, std::ptrdiff_t stride, int lanes) {
  std::vector<double> start(lanes, 0.0), carry(lanes);
  const int horizon = std::min(kHorizon, count - 1);
  double weight = 1;
  for (int k = 0; k <= horizon; ++k, weight *= kPole)
    for (int l = 0; l < lanes; ++l) start[l] += weight * data[k * stride + l];
  for (int l = 0; l < lanes; ++l) data[l] = static_cast<float>(carry[l] = start[l]);
  for (int k = 1; k < count; ++k)
    for (int l = 0; l < lanes; ++l)
      data[k * stride + l] = static_cast<float>(carry[l] = data[k * stride + l] + kPole * carry[l]);
  float* last = data + (count - 1) * stride;
  const float* before = last - stride;
  for (int l = 0; l < lanes; ++l) {
    carry[l] = kPole / (kPole * kPole - 1) * (static_cast<double>(last[l]) + kPole * before[l]);
    last[l] = static_cast<float>(6 * carry[l]);
  }
  for (int k = count - 2; k >= 0; --k)
    for (int l = 0; l < lanes; ++l) {
      carry[l] = kPole * (carry[l] - data[k * stride + l]);
      data[k * stride + l] = static_cast<float>(6 * carry[l]);
    }
}

/// β³ at t + 1, t, t − 1, t − 2 for 0 <= t < 1, and its derivative.
void basis(double t, double value[4], double slope[4]) {
  const double s = 1 - t;
  value[0] = s * s * s / 6;
  value[1] = 2.0 / 3 - t * t * (2 - t) / 2;
  value[2] = 2.0 / 3 - s * s * (2 - s) / 2;
  value[3] = t * t * t / 6;
  slope[0] = -s * s / 2;
  slope[1] = -2 * t + 1.5 * t * t;
  slope[2] = 2 * s - 1.5 * s * s;
  slope[3] = t * t / 2;
}

}  // namespace

SplineImage::SplineImage(const cv::Mat& grey) {
  require(grey.type() == CV_32F && grey.cols >= 4 && grey.rows >= 4,
          "SplineImage: needs one float channel and at least 4 x 4 px");
  coefficients_ = grey.clone();
  cv::parallel_for_(cv::Range(0, grey.rows), [&](const cv::Range& range) {
    for (int y = range.start; y < range.end; ++y) transform(coefficients_.ptr<float>(y), grey.cols, 1, 1);
  });
  // Columns in fixed blocks: neighbouring columns share cache lines, and blocks do not depend on the threads.
  constexpr int kBlock = 64;
  cv::parallel_for_(cv::Range(0, (grey.cols + kBlock - 1) / kBlock), [&](const cv::Range& range) {
    for (int b = range.start; b < range.end; ++b)
      transform(coefficients_.ptr<float>(0) + b * kBlock, grey.rows,
                static_cast<std::ptrdiff_t>(coefficients_.step1()), std::min(kBlock, grey.cols - b * kBlock));
  });
}

namespace {

/// Weights of a line's points at whole pixels about its middle: each point by cubic interpolation, which keeps moments up to
/// the third.
cv::Mat line_kernel(const Vec2& line) {
  const int reach = static_cast<int>(std::ceil(0.5 * line.cwiseAbs().maxCoeff())) + 2;
  cv::Mat kernel = cv::Mat::zeros(2 * reach + 1, 2 * reach + 1, CV_32F);
  const int points = 4 * static_cast<int>(std::ceil(line.norm())) + 4;
  const auto weights = [](double t) -> std::array<double, 4> {  // at −1, 0, 1, 2
    return {-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2,
            (t + 1) * t * (t - 1) / 6};
  };
  for (int k = 0; k < points; ++k) {
    const Vec2 at = ((k + 0.5) / points - 0.5) * line;
    const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
    const auto wx = weights(at.x() - x), wy = weights(at.y() - y);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        kernel.at<float>(reach + y - 1 + j, reach + x - 1 + i) += static_cast<float>(wx[i] * wy[j] / points);
  }
  return kernel;
}

}  // namespace

SplineImage SplineImage::averaged(const cv::Rect& area, const Vec2& line) const {
  const cv::Rect inside = (area - origin_) & cv::Rect(0, 0, cols(), rows());
  SplineImage part;
  part.origin_ = origin_ + inside.tl();
  // Of the coefficients, since both are convolutions; pixels beside the area count.
  if (!inside.empty()) cv::filter2D(coefficients_(inside), part.coefficients_, CV_32F, line_kernel(line));
  return part;
}

SplineImage::Sample SplineImage::sample(double x, double y) const {
  x -= origin_.x, y -= origin_.y;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  double wx[4], dx[4], wy[4], dy[4];
  basis(x - i, wx, dx);
  basis(y - j, wy, dy);
  Sample out{0, 0, 0};
  for (int row = 0; row < 4; ++row) {
    const float* c = coefficients_.ptr<float>(j - 1 + row) + (i - 1);
    const double along = wx[0] * c[0] + wx[1] * c[1] + wx[2] * c[2] + wx[3] * c[3];
    const double slope = dx[0] * c[0] + dx[1] * c[1] + dx[2] * c[2] + dx[3] * c[3];
    out.value += wy[row] * along;
    out.dx += wy[row] * slope;
    out.dy += dy[row] * along;
  }
  return out;
}

}  // namespace rhytid::fitting
