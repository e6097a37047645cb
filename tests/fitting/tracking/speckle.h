// Synthetic skin: a sum of random Gaussians on a material plane, seen through a known motion. The picture is
// a closed formula, so that sub-pixel positions are exact and no interpolation is involved.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting::testing {

/// x = translation + gradient (X − centre) + centre.
struct AffineMotion {
  Vec2 translation = Vec2::Zero();
  Eigen::Matrix2d gradient = Eigen::Matrix2d::Identity();
  Vec2 centre = Vec2::Zero();

  Vec2 forward(const Vec2& X) const { return translation + centre + gradient * (X - centre); }
  Vec2 backward(const Vec2& x) const { return centre + gradient.inverse() * (x - translation - centre); }
};

class Speckle {
 public:
  /// Spots over width × height px and a border around it; radii 1.6 to 3 px, one spot per 14 px².
  Speckle(int width, int height, unsigned seed) : width_(width), height_(height) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    const int border = 60, columns = (width + 2 * border) / kCell + 1,
              rows = (height + 2 * border) / kCell + 1;
    cells_.resize(static_cast<std::size_t>(columns) * rows);
    columns_ = columns;
    rows_ = rows;
    origin_ = Vec2::Constant(-border);
    const int count = (width + 2 * border) * (height + 2 * border) / 14;
    for (int i = 0; i < count; ++i) {
      const Vec2 p =
          origin_ + Vec2(unit(random) * (width + 2 * border), unit(random) * (height + 2 * border));
      const double radius = 1.6 + 1.4 * unit(random),
                   amplitude = (unit(random) < 0.5 ? -1 : 1) * (20 + 30 * unit(random));
      cells_[cell(p)].push_back({p, 0.5 / (radius * radius), amplitude});
    }
  }

  /// Grey value of the material point X.
  double value(const Vec2& X) const {
    double sum = 128;
    const int cx = static_cast<int>((X.x() - origin_.x()) / kCell),
              cy = static_cast<int>((X.y() - origin_.y()) / kCell);
    for (int y = std::max(0, cy - 1); y <= std::min(rows_ - 1, cy + 1); ++y)
      for (int x = std::max(0, cx - 1); x <= std::min(columns_ - 1, cx + 1); ++x)
        for (const Spot& s : cells_[static_cast<std::size_t>(y) * columns_ + x])
          sum += s.amplitude * std::exp(-s.inverse * (X - s.centre).squaredNorm());
    return sum;
  }

  /// 8-bit picture: gain · value(backward(x)) + bias + noise, rounded. `backward` maps pixels to material
  /// points.
  cv::Mat render(const std::function<Vec2(const Vec2&)>& backward, double noise, unsigned seed,
                 double gain = 1, double bias = 0) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    cv::Mat image(height_, width_, CV_8U);
    for (int y = 0; y < height_; ++y)
      for (int x = 0; x < width_; ++x) {
        const double v = gain * value(backward({x, y})) + bias + noise * normal(random);
        image.at<uchar>(y, x) = cv::saturate_cast<uchar>(v);
      }
    return image;
  }

 private:
  static constexpr int kCell =
      14;  // more than 4.5 of the largest radius: what lies further adds less than 1e-3
  struct Spot {
    Vec2 centre;
    double inverse, amplitude;
  };
  std::size_t cell(const Vec2& p) const {
    const Vec2 c = (p - origin_) / kCell;
    return static_cast<std::size_t>(c.y()) * columns_ + static_cast<std::size_t>(c.x());
  }
  int width_, height_, columns_ = 0, rows_ = 0;
  Vec2 origin_;
  std::vector<std::vector<Spot>> cells_;
};

}  // namespace rhytid::fitting::testing
