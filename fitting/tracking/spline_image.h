// A grey image as a continuous function: the cubic B-spline that interpolates the pixels.
//
//   I(x, y) = Σ_ij c_ij β³(x − i) β³(y − j),   c from I(i, j) = pixel by two recursive filters, mirrored ends
//
// Source  Unser, Aldroubi, Eden, "B-spline signal processing II", IEEE Trans. Signal Proc. 41 (1993) 834-848.
// Why     its interpolation bias in sub-pixel matching is an order below that of bilinear or Keys' bicubic.
// Tests   tests/fitting/tracking/spline_image_test.cpp
#pragma once

#include <opencv2/core.hpp>

#include "sim/core/types.h"

namespace rhytid::fitting {

class SplineImage {
 public:
  SplineImage() = default;
  /// grey: CV_32F, one channel, at least 4 x 4 px. Throws ContractError otherwise.
  explicit SplineImage(const cv::Mat& grey);

  /// Value and gradient at (x, y) px, pixel centres at integers.
  struct Sample {
    double value, dx, dy;
  };
  /// Needs contains(x, y).
  Sample sample(double x, double y) const;

  /// All 16 coefficients around (x, y) exist.
  bool contains(double x, double y) const {
    x -= origin_.x, y -= origin_.y;
    return x >= 1 && y >= 1 && x < cols() - 2 && y < rows() - 2;
  }

  /// The part within `area`, each value the mean along a line about its place (length and direction in px; its moments
  /// up to the third are exact). In the coordinates of the whole.
  SplineImage averaged(const cv::Rect& area, const Vec2& line) const;

  int cols() const { return coefficients_.cols; }
  int rows() const { return coefficients_.rows; }

 private:
  cv::Mat coefficients_;  // CV_32F
  cv::Point origin_;      // px of the first coefficient
};

}  // namespace rhytid::fitting
