// Follows points of the skin through footage: pyramidal optical flow predicts, alignment with a template from
// the reference frame measures. README.md of this folder states the method. Tests:
// tests/fitting/tracking/tracker_test.cpp
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fitting/observations.h"
#include "fitting/tracking/frame_source.h"
#include "fitting/tracking/occluder.h"
#include "fitting/tracking/patch_alignment.h"
#include "fitting/tracking/seeds.h"

namespace rhytid::fitting {

/// What happened in one frame.
struct FrameCounts {
  int frame = 0;
  double time_s = 0;
  int ok = 0, occluded = 0, lost = 0, outside = 0;
  int template_updates = 0;
  int redetected = 0;
  double residual_grey =
      0;  ///< median residual of the accepted windows: noise of both smoothed images together, grey
  double forward_backward_px = 0;  ///< median over accepted tracks, as in TrackerReport
};

/// Why a measurement was refused.
enum class Refusal {
  none,
  occluded,          ///< window covered by the mask
  outside,           ///< window left the image
  flow,              ///< optical flow found nothing
  forward_backward,  ///< flow there and back did not return
  not_converged,     ///< alignment found no minimum
  correlation,       ///< below min_correlation
  residual,          ///< residual jumped: something covers part of the window, or the skin folded
  correction,        ///< alignment disagrees with the flow
  uncertain,         ///< standard deviation above max_sigma_px
  neighbours,        ///< moved unlike its neighbours and fits badly: something else that looks alike
};
inline constexpr int kNumRefusals = 11;
const char* to_string(Refusal refusal);

struct TrackerOptions {
  std::string camera = "camera";  ///< written into the tracks
  SeedOptions seeds;
  OccluderOptions occluder;
  /// Further mask per frame (CV_8U, 255 = covered; may be empty), joined with the occluder's.
  std::function<cv::Mat(const Frame&)> mask;

  int window_px = 21;  ///< odd; side of the window that is aligned and flowed
  /// Standard deviation of the Gaussian that smooths frames before alignment, px. Noise in the gradients
  /// would make the normal matrix too large and the covariance too small; 0.8 px removes most of it and
  /// little texture.
  double smoothing_px = 0.8;
  int pyramid_levels = 3;               ///< flow reaches about window_px/2 · 2^levels px per frame
  WarpModel model = WarpModel::affine;  ///< deformation of the window since its template was taken
  double max_forward_backward_px = 1.0;
  double max_correction_px = 1.5;  ///< between flow and alignment
  double min_correlation = 0.6;
  double max_residual_jump = 2.5;      ///< over the track's last residual and the median of the frame
  double max_sigma_px = 0.5;           ///< largest standard deviation in any direction
  double max_covered_fraction = 0.02;  ///< of the window under the mask

  /// A template is renewed when its residual has grown by this factor over its first one and the correlation
  /// is below update_correlation: the skin in the window has deformed beyond the warp model. The uncertainty
  /// so far is carried over, so renewing is a last resort. 0 = never.
  double update_residual_ratio = 1.6;
  double update_correlation = 0.9;
  double max_gradient_change = 0.4;  ///< also renewed when |A − I| exceeds this

  bool redetect = true;  ///< look for lost points where their neighbours say they should be (redetection.h)
  double redetect_search_px = 6;
  double redetect_min_correlation = 0.8;
  double redetect_max_return_px = 0.5;  ///< from the seed, where what was found ends in the first frame

  /// Share of the frame interval that the shutter is open, 0..1, whose blur is allowed for (motion_blur.h); 0 = it is not.
  /// Nothing: found out from the residuals.
  std::optional<double> exposure;

  /// Called after every frame; returning false stops the run (the report says interrupted).
  std::function<bool(const FrameCounts&, int frames_processed, int frames_asked)> progress;

  /// Throws InputError naming the option, its value and what is expected.
  void validate() const;
};

enum class TrackerEnd {
  finished,            ///< all frames asked for were processed
  source_ended_early,  ///< the footage had fewer frames than asked for or announced
  interrupted,         ///< by the progress callback
};
const char* to_string(TrackerEnd end);

struct TrackerReport {
  TrackerEnd end = TrackerEnd::finished;
  int frames_asked = 0;
  int frames_processed = 0;
  int seeds_refused = 0;  ///< points without texture or too close to the border
  int started = 0;
  int kept = 0;      ///< ok in the last frame
  int unbroken = 0;  ///< ok in every frame
  int template_updates = 0;
  int redetected = 0;
  /// Flow from one frame to the next and back: distance from where it began, over all accepted measurements.
  /// It judges the prediction in single frames and knows no drift (there_and_back.h does).
  double forward_backward_median_px = 0;
  double forward_backward_95_px = 0;
  double exposure = 0;         ///< share of the frame interval, given or found; 0 where blur does not tell it
  double noise_grey = 0;       ///< per smoothed image: median residual / √2
  double jitter_px = 0;        ///< what tracks jump beside their neighbours (jitter.h); in the covariances
  double sigma_median_px = 0;  ///< of displacements since the first frame: median of sqrt(trace/2)
  std::array<int, kNumRefusals> refusals{};  ///< times a track was refused, by Refusal
  std::vector<FrameCounts> frames;
};

/// One or two plain lines for a terminal or a report.
std::string summary(const TrackerReport& report);

struct TrackerResult {
  TrackSet tracks;
  TrackerReport report;
};

/// Follows points from the first frame of `source` to the last. The result does not depend on the number of
/// threads. Throws InputError on options out of range, on no usable point, and on an unreadable frame.
TrackerResult track(FrameSource& source, const TrackerOptions& options);

}  // namespace rhytid::fitting
