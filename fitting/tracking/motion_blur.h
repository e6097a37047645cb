// What an open shutter does to a window that moves, and how windows that are blurred differently are compared.
//
// While the shutter is open, for the share e of the frame interval, a point that moves by v px a frame draws a line of length
// e |v|, which adds e² v vᵀ/12 to the second moments of the picture about it. A template from the first frame, where the point
// moved by V, and frame f, where it moves by v with deformation A, differ by (in the template's pixels)
//
//   e² (w wᵀ − V Vᵀ)/12,   w = A⁻¹ v
//
// which has a positive eigenvalue, by whose line the template is blurred, and a negative one, by whose line the frame is: each
// by what the other is blurred more, and none where both moved alike. Exact, for an even motion, where one of them stood still.
//
// e is given, or that for which residuals of the windows that tell are least, a parabola through five values, with what
// blurring takes of their noise allowed for: every third window of the frames so far, until Shutter::kEnough are known. A mean over
// the exposure is e² a/24 off the place at its middle, a the acceleration in px per frame²; that is taken off. Where speed jumps
// there is no such a: what a jump may do is in the covariance.
//
// Units  px, frames.   Tests  tests/fitting/tracking/motion_blur_test.cpp
#pragma once

#include <array>
#include <optional>

#include "fitting/tracking/follower.h"

namespace rhytid::fitting {

/// Lines that two pictures of a window are averaged along.
struct RelativeBlur {
  Vec2 of_template = Vec2::Zero();  ///< px of the template
  Vec2 of_image = Vec2::Zero();     ///< px of the frame
  double longest() const { return std::max(of_template.norm(), of_image.norm()); }
};

/// For motions per frame `first` where the template is from and `now`, deformation `gradient`, and a shutter open for `exposure`.
RelativeBlur relative_blur(const Vec2& first, const Vec2& now, const Eigen::Matrix2d& gradient,
                           double exposure);

/// Motions per frame of a follower in the first frame and now, if it was seen in this frame at `place`, and in the first three
/// and the last one. Nothing when it was not, or has another template.
struct Motions {
  Vec2 first, now;
};
std::optional<Motions> motions_of(const Follower& follower, const Vec2& place);

/// Covariance of what the lines leave, px²: 0.0045 px for every px² of a line's length, along it. Light is not averaged as grey
/// values are, and the window does not move as one. Found on bench tracker's speckle, where it is too large since its films are
/// blurred as they say (0.5 to 1 deviations); on the twin and the face it is too small: a compromise.
Eigen::Matrix2d blur_misfit(const RelativeBlur& blur);

/// Variance of the noise of a residual between pictures averaged along the lines, over that without.
double noise_after(const RelativeBlur& blur, const TrackerOptions& options);

/// Aligns template and frame, each averaged along its line, from `start` on.
Measurement measure_blurred(const Follower& follower, const PatchWarp& start, const RelativeBlur& blur,
                            const FrameView& view, const TrackerOptions& options);

/// The share of the frame interval that the shutter is open, from the residuals of windows.
class Shutter {
 public:
  static constexpr std::array<double, 5> kCandidates = {0, 0.25, 0.5, 0.75, 1};
  static constexpr int kEnough = 150;  ///< windows

  /// Compares the candidates at an accepted alignment without blur, when the window tells them apart.
  /// Nothing when it does not.
  static std::optional<std::array<double, 5>> compare(const Follower& follower, const Alignment& alignment,
                                                      const FrameView& view, const TrackerOptions& options);
  void add(const std::array<double, 5>& costs);
  bool is_known() const { return windows_ >= kEnough; }
  /// 0 until enough windows tell.
  double exposure() const;

 private:
  std::array<double, 5> sum_{};
  int windows_ = 0;
};

/// Takes e² a/24 off the positions of a track, against that of its first, and adds to covariances what jumps of speed may do.
void remove_acceleration(double exposure, Track* track);

}  // namespace rhytid::fitting
