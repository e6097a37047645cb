#include "tools/bench/filmed_skin.h"

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

namespace rhytid::tools {
namespace {

using std::numbers::pi;

struct Rolled {
  Vec2 shift;
  double cosine, sine, zoom;
};

Rolled rolled(const HeadRoll& h, double t) {
  const double phase = 2 * pi * t / h.period, angle = h.turn * std::sin(phase);
  const double pushed = h.swipe_px * (1 - std::cos(2 * pi * t / h.swipe_period)) / 2;
  return {h.shift_px * Vec2(std::sin(phase), 0.5 * std::sin(2 * phase)) + pushed * Vec2(0.8, 0.6),
          std::cos(angle), std::sin(angle), 1 + h.zoom * std::sin(phase)};
}

class PlaneSkin : public FilmedSkin {
 public:
  PlaneSkin(const cv::Mat& texture, double scale, cv::Size size, int frames, const cv::Rect& region)
      : scale_(scale),
        size_(size),
        frames_(frames),
        region_(region),
        middle_(size.width / 2., size.height / 2.) {
    cv::Mat linear;
    cv::pow(cv::max(texture, 0) / 255, kGamma, linear);
    texture_ = fitting::SplineImage(linear);
    pull_.centre = Vec2(region.x + region.width / 2., region.y + region.height / 2.);
    pull_.frames = frames - 1;
  }
  cv::Size size() const override { return size_; }
  int frames() const override { return frames_; }
  cv::Mat light(double t, const HeadRoll& head) const override {
    cv::Mat out(size_, CV_32F);
    const Vec2 origin(texture_.cols() / 2., texture_.rows() / 2.);
    cv::parallel_for_(cv::Range(0, size_.height), [&](const cv::Range& rows) {
      for (int y = rows.start; y < rows.end; ++y)
        for (int x = 0; x < size_.width; ++x) {
          const Vec2 at = origin + scale_ * (pull_.backward(head.backward({x, y}, t), t) - middle_);
          // The texture's last pixels go on beyond its edge; no point is followed there.
          out.at<float>(y, x) = static_cast<float>(texture_
                                                       .sample(std::clamp(at.x(), 1., texture_.cols() - 3.),
                                                               std::clamp(at.y(), 1., texture_.rows() - 3.))
                                                       .value);
        }
    });
    return out;
  }
  std::vector<Vec2> path(const Vec2& first, const HeadRoll& head) const override {
    const Vec2 X = pull_.backward(head.backward(first, 0), 0);
    std::vector<Vec2> list;
    for (int f = 0; f < frames_; ++f) list.push_back(head.forward(pull_.forward(X, f), f));
    return list;
  }
  void prepare(const HeadRoll&, fitting::TrackerOptions* o) const override { o->seeds.region = region_; }

 private:
  fitting::SplineImage texture_;  // linear light
  double scale_;
  cv::Size size_;
  int frames_;
  cv::Rect region_;
  Vec2 middle_;
  Pull pull_;
};

}  // namespace

Vec2 HeadRoll::forward(const Vec2& x, double t) const {
  const Rolled r = rolled(*this, t);
  const Vec2 d = x - centre;
  return centre + r.shift +
         r.zoom * Vec2(r.cosine * d.x() - r.sine * d.y(), r.sine * d.x() + r.cosine * d.y());
}

Vec2 HeadRoll::backward(const Vec2& x, double t) const {
  const Rolled r = rolled(*this, t);
  const Vec2 d = (x - centre - r.shift) / r.zoom;
  return centre + Vec2(r.cosine * d.x() + r.sine * d.y(), -r.sine * d.x() + r.cosine * d.y());
}

Vec2 Pull::forward(const Vec2& X, double t) const {
  const double amount = amplitude_px * (1 - std::cos(pi * t / frames)) / 2;
  return X + amount * direction * std::exp(-(X - centre).squaredNorm() / (2 * reach_px * reach_px));
}

Vec2 Pull::backward(const Vec2& x, double t) const {
  // Contracts by the strain, below 0.05: ten steps are exact.
  Vec2 X = x;
  for (int k = 0; k < 10; ++k) X = x - (forward(X, t) - X);
  return X;
}

std::unique_ptr<FilmedSkin> make_plane_skin(const cv::Mat& texture, double scale, cv::Size size, int frames,
                                            const cv::Rect& region) {
  return std::make_unique<PlaneSkin>(texture, scale, size, frames, region);
}

cv::Mat speckle_texture(cv::Size size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  const int border = 60, width = 2 * (size.width + 2 * border), height = 2 * (size.height + 2 * border);
  cv::Mat grey(height, width, CV_32F, cv::Scalar(128));
  for (int i = 0; i < width * height / (4 * 14); ++i) {
    const Vec2 at(unit(random) * width, unit(random) * height);
    const double radius = 2 * (1.6 + 1.4 * unit(random)), inverse = 0.5 / (radius * radius);
    const double amplitude = (unit(random) < 0.5 ? -1 : 1) * (10 + 15 * unit(random));
    const int reach = static_cast<int>(std::ceil(4.5 * radius));  // beyond: less than 1e-3 grey
    const int x0 = static_cast<int>(at.x()), y0 = static_cast<int>(at.y());
    for (int y = std::max(0, y0 - reach); y <= std::min(height - 1, y0 + reach); ++y)
      for (int x = std::max(0, x0 - reach); x <= std::min(width - 1, x0 + reach); ++x)
        grey.at<float>(y, x) +=
            static_cast<float>(amplitude * std::exp(-inverse * (Vec2(x, y) - at).squaredNorm()));
  }
  return cv::max(grey, 1);
}

}  // namespace rhytid::tools
