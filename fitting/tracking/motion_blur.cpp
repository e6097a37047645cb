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
/// And that is so many times what deformation does to the smoothing of the pictures.
constexpr double kClear = 5;

bool is_ok(const Observation& o) {
  return o.status == TrackStatus::ok;
}

/// Whether `next` goes on from `here` smoothly enough to extrapolate: else something began or stopped between them.
bool agree(const Vec2& here, const Vec2& next) {
  return (next - here).norm() <= 0.5 * here.norm();
}

/// Speed at the outer end of a frame interval, from the motion in it and in the one beside it: to second order, or where that
/// is no smooth motion the mean of the interval.
Vec2 speed_at_end(const Vec2& interval, const Vec2& beside) {
  return agree(interval, beside) ? Vec2(1.5 * interval - 0.5 * beside) : interval;
}

/// The acceleration in a frame, if it is that of a smooth motion; and by how much the speed may jump there.
struct Bend {
  Vec2 acceleration = Vec2::Zero(), jump = Vec2::Zero();
};

/// Of observation i, px per frame²; nothing of neither where too little was seen beside it.
Bend bend_at(const std::vector<Observation>& list, std::size_t i) {
  const auto seen = [&](std::size_t k) {  // k may have passed below 0
    return k - 1 < list.size() && k + 1 < list.size() && is_ok(list[k - 1]) && is_ok(list[k]) &&
           is_ok(list[k + 1]);
  };
  const auto second = [&](std::size_t k) -> Vec2 {
    return list[k + 1].pixel - 2 * list[k].pixel + list[k - 1].pixel;
  };
  if (seen(i)) {
    const Vec2 here = second(i);
    const bool before = seen(i - 1), after = seen(i + 1);
    const Vec2 earlier = before ? second(i - 1) : Vec2::Zero(), later = after ? second(i + 1) : Vec2::Zero();
    const auto of_motion = [&](const Vec2& difference) { return Bend{here, difference}; };
    if (before && after && agree(here, earlier) && agree(here, later))
      return of_motion((earlier - here).norm() > (later - here).norm() ? earlier - here : later - here);
    // Next to an end two on the other side have to go on, since a jump between two frames shows in both alike.
    if (before && !after && seen(i - 2) && agree(here, earlier) && agree(earlier, second(i - 2)))
      return of_motion(earlier - here);
    if (after && !before && seen(i + 2) && agree(here, later) && agree(later, second(i + 2)))
      return of_motion(later - here);
    // All of the jump, whose differences spread over two frames or three.
    return {Vec2::Zero(), earlier + here + later};
  }
  // At the ends of what was seen without a gap straight on from those beside, if these are of one motion.
  const bool forth = seen(i + 1);
  const std::size_t next = forth ? i + 1 : i - 1, after = forth ? i + 2 : i - 2;
  if (!seen(next)) return {};
  const Vec2 near = second(next);
  // What rests has no acceleration yet.
  if ((list[next].pixel - list[i].pixel).norm() < 0.25 * near.norm()) return {};
  if (!seen(after)) return {Vec2::Zero(), near};
  const Vec2 far = second(after);
  if (agree(near, far)) return {2 * near - far, far - near};
  return {Vec2::Zero(), (far - near).norm() < near.norm() ? Vec2(far - near) : near};
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

/// By how much a picture that is smoothed as it is has other second moments than the template, px² of the template, because
/// skin is deformed meanwhile: the largest eigenvalue of s² (A⁻¹A⁻ᵀ − I), by size.
double smoothing_change(const Eigen::Matrix2d& gradient, double smoothing_px) {
  const Eigen::Matrix2d inverse = gradient.inverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(inverse * inverse.transpose(),
                                                             Eigen::EigenvaluesOnly);
  const double pixel = 1. / 12;  // which averages too
  return (smoothing_px * smoothing_px + pixel) * (eigen.eigenvalues().array() - 1).abs().maxCoeff();
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
  const Vec2 first = speed_at_end(seen[1].pixel - seen[0].pixel, third - seen[1].pixel);
  const Vec2 step = place - seen[n - 1].pixel;
  if (!is_ok(seen[n - 2])) return Motions{first, step};
  return Motions{first, speed_at_end(step, seen[n - 1].pixel - seen[n - 2].pixel)};
}

double noise_after(const RelativeBlur& blur, const TrackerOptions& o) {
  return 0.5 * (noise_left(blur.of_template.norm(), o.smoothing_px) +
                noise_left(blur.of_image.norm(), o.smoothing_px));
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
  if (!motions) return std::nullopt;
  const double line = relative_blur(motions->first, motions->now, a.warp.gradient, 1).longest();
  if (line < kTelling || line * line / 12 < kClear * smoothing_change(a.warp.gradient, o.smoothing_px))
    return std::nullopt;
  std::array<double, 5> costs{};
  for (std::size_t k = 0; k < costs.size(); ++k) {
    const RelativeBlur blur = relative_blur(motions->first, motions->now, a.warp.gradient, kCandidates[k]);
    const Measurement m = measure_blurred(f, a.warp, blur, view, o);
    if (m.refusal != Refusal::none) return std::nullopt;
    costs[k] = std::log(m.alignment.residual_rms * m.alignment.residual_rms / noise_after(blur, o));
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
  if (list.empty()) return;
  std::vector<Bend> bends;
  for (std::size_t i = 0; i < list.size(); ++i) bends.push_back(bend_at(list, i));
  const double e = exposure;
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (!is_ok(list[i])) continue;
    list[i].pixel -= e * e / 24 * (bends[i].acceleration - bends[0].acceleration);
    // A jump Δ at any time of the frame, all alike, puts the mean off by e³ΔΔᵀ/320 in the mean square.
    list[i].covariance += e * e * e / 320 * bends[i].jump * bends[i].jump.transpose();
  }
}

}  // namespace rhytid::fitting
