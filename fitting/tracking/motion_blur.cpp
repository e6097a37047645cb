#include "fitting/tracking/motion_blur.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace rhytid::fitting {
namespace {

/// Shorter lines than this change the picture by less than its smoothing.
constexpr double kShortest = 0.7;
/// A window tells how long the shutter is open when it would be blurred by this if that were always.
constexpr double kTelling = 2;

bool is_ok(const Observation& o) {
  return o.status == TrackStatus::ok;
}

/// Variance of noise of a frame that is averaged along a line, over that of the frame: the mean of its autocorrelation
/// between two places of the line, exp(−d²/4s²) for white noise smoothed by s.
double noise_left(double length, double smoothing_px) {
  constexpr int kPieces = 16;
  const double s = std::max(smoothing_px, 0.5);  // an interpolated pixel is not white either
  double sum = 0;
  for (int k = 0; k < kPieces; ++k) {
    const double share = (k + 0.5) / kPieces, d = share * length;
    sum += 2 * (1 - share) * std::exp(-d * d / (4 * s * s)) / kPieces;
  }
  return sum;
}

}  // namespace

RelativeBlur relative_blur(const Vec2& first, const Vec2& now, const Eigen::Matrix2d& gradient,
                           double exposure) {
  const Vec2 w = gradient.inverse() * now;
  const Eigen::Matrix2d difference = exposure * exposure * (w * w.transpose() - first * first.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(difference);
  RelativeBlur blur;
  blur.of_template = std::sqrt(std::max(0.0, eigen.eigenvalues()[1])) * eigen.eigenvectors().col(1);
  blur.of_image =
      gradient * (std::sqrt(std::max(0.0, -eigen.eigenvalues()[0])) * eigen.eigenvectors().col(0));
  if (blur.of_template.norm() < kShortest) blur.of_template.setZero();
  if (blur.of_image.norm() < kShortest) blur.of_image.setZero();
  return blur;
}

Eigen::Matrix2d blur_misfit(const RelativeBlur& blur) {
  constexpr double kOfSquare = 0.0045;
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  for (const Vec2& line : {blur.of_template, blur.of_image})
    sum += line.squaredNorm() * line * line.transpose();
  return kOfSquare * kOfSquare * sum;
}

std::optional<Motions> motions_of(const Follower& f, const Vec2& place) {
  const auto& seen = f.track.observations;
  const std::size_t n = seen.size();
  if (!f.has_first_template || n < 2 || !is_ok(seen[0]) || !is_ok(seen[1]) || !is_ok(seen[n - 1]))
    return std::nullopt;
  if (n > 2 && !is_ok(seen[2])) return std::nullopt;
  const Vec2& third = n > 2 ? seen[2].pixel : place;
  // By differences of the two frame intervals beside, to second order.
  const Vec2 first = 1.5 * (seen[1].pixel - seen[0].pixel) - 0.5 * (third - seen[1].pixel);
  const Vec2 step = place - seen[n - 1].pixel;
  if (!is_ok(seen[n - 2])) return Motions{first, step};
  return Motions{first, 1.5 * step - 0.5 * (seen[n - 1].pixel - seen[n - 2].pixel)};
}

Measurement measure_blurred(const Follower& f, const PatchWarp& start, const RelativeBlur& blur,
                            const FrameView& view, const TrackerOptions& o) {
  Measurement m;
  m.refusal = Refusal::outside;
  const int half = f.patch.half;
  constexpr int kMargin = 5;  // the alignment moves, and needs the spline's reach
  const auto averaged = [&](const SplineImage& image, const Vec2& centre, int reach, const Vec2& line) {
    return image.averaged({static_cast<int>(std::floor(centre.x())) - reach,
                           static_cast<int>(std::floor(centre.y())) - reach, 2 * reach + 2, 2 * reach + 2},
                          line);
  };
  PatchTemplate patch = f.patch;
  if (!blur.of_template.isZero())
    patch = cut_template(averaged(*view.first, f.seed, half + kMargin, blur.of_template), f.seed, half);
  if (patch.values.empty()) return m;
  FrameView of_blurred = view;
  SplineImage image;
  if (!blur.of_image.isZero()) {
    const int reach =
        static_cast<int>(std::ceil(half * start.gradient.cwiseAbs().rowwise().sum().maxCoeff())) + kMargin;
    image = averaged(*view.image, start.centre, reach, blur.of_image);
    of_blurred.image = &image;
  }
  m.refusal = try_align(patch, start, start.gradient, o.max_correction_px, of_blurred, o, o.min_correlation,
                        &m.alignment);
  return m;
}

std::optional<std::array<double, 5>> Shutter::compare(const Follower& f, const Alignment& a,
                                                      const FrameView& view, const TrackerOptions& o) {
  const std::optional<Motions> motions = motions_of(f, a.warp.centre);
  if (!motions || relative_blur(motions->first, motions->now, a.warp.gradient, 1).longest() < kTelling)
    return std::nullopt;
  std::array<double, 5> costs{};
  for (std::size_t k = 0; k < costs.size(); ++k) {
    const RelativeBlur blur = relative_blur(motions->first, motions->now, a.warp.gradient, kCandidates[k]);
    const Measurement m = measure_blurred(f, a.warp, blur, view, o);
    if (m.refusal != Refusal::none) return std::nullopt;
    const double left = 0.5 * (noise_left(blur.of_template.norm(), o.smoothing_px) +
                               noise_left(blur.of_image.norm(), o.smoothing_px));
    costs[k] = std::log(m.alignment.residual_rms * m.alignment.residual_rms / left);
  }
  return costs;
}

void Shutter::add(const std::array<double, 5>& costs) {
  for (std::size_t k = 0; k < costs.size(); ++k) sum_[k] += costs[k];
  ++windows_;
}

double Shutter::exposure() const {
  constexpr int kFewest = 12;
  // In the mean a window has to fit better by this, ln of the variance: less is not worth a blur.
  constexpr double kBetter = 0.05;
  if (windows_ < kFewest) return 0;
  const std::size_t best =
      static_cast<std::size_t>(std::min_element(sum_.begin(), sum_.end()) - sum_.begin());
  if (!(sum_[0] - sum_[best] > kBetter * windows_)) return 0;
  if (best == 0 || best + 1 == sum_.size()) return kCandidates[best];
  const double below = sum_[best - 1], here = sum_[best], above = sum_[best + 1];
  return kCandidates[best] + 0.25 * 0.5 * (below - above) / (below - 2 * here + above);
}

void remove_acceleration(double exposure, Track* track) {
  auto& list = track->observations;
  std::vector<std::optional<Vec2>> bend(list.size());
  for (std::size_t i = 1; i + 1 < list.size(); ++i)
    if (is_ok(list[i - 1]) && is_ok(list[i]) && is_ok(list[i + 1]))
      bend[i] = list[i + 1].pixel - 2 * list[i].pixel + list[i - 1].pixel;
  // At the ends of what was seen without a gap straight on from those beside.
  const auto seen = [&](std::size_t i) {
    return i < bend.size() && bend[i].has_value();
  };  // i may have passed below 0
  const auto extended = [&](std::size_t i) -> Vec2 {
    if (seen(i)) return *bend[i];
    if (seen(i + 1)) return seen(i + 2) ? Vec2(2 * *bend[i + 1] - *bend[i + 2]) : *bend[i + 1];
    if (seen(i - 1)) return seen(i - 2) ? Vec2(2 * *bend[i - 1] - *bend[i - 2]) : *bend[i - 1];
    return Vec2::Zero();
  };
  if (list.empty()) return;
  const Vec2 of_first = extended(0);
  for (std::size_t i = 1; i < list.size(); ++i)
    if (is_ok(list[i])) list[i].pixel -= exposure * exposure / 24 * (extended(i) - of_first);
}

}  // namespace rhytid::fitting
