// What a camera and a lamp make of a skin whose motion is known, how the tracker fares on it, and in what it errs.
//
// Light is added and averaged in linear light over the time that the shutter is open, which is symmetric about the
// frame's time; then comes the encoding, noise, rounding, and the codec.
// Tests  tests/tools/tracker_bench_test.cpp
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "fitting/tracking/tracker.h"
#include "tools/bench/filmed_skin.h"

namespace rhytid::tools {

/// Pictures that a whole frame interval is averaged of.
inline constexpr int kSubframes = 8;

/// One way of filming. Times run from 0 at the first frame to 1 at the last, places from 0 to 1 across the picture.
struct Filming {
  std::string name, description;
  double exposure = 0;  ///< share of the frame interval that the shutter is open
  double noise = 1.5;   ///< standard deviation, grey
  HeadRoll head = {};   ///< centre is set to the picture's
  /// Factor of the light, and light added; by place (x right, y down; both over the width) and time.
  std::function<double(double x, double y, double time)> gain = {}, added = {};
  std::vector<double> flicker = {};  ///< factor of every frame, repeated
  double defocus_px = 0;             ///< deviation of a Gaussian blur at the end, growing from 0
  bool has_disc = false;             ///< a textured disc passes
  bool is_disc_masked = false;       ///< and the tracker is told where
  bool redetect = true;              ///< lost points are looked for
  bool h264 = false;
};

/// Those that are studied; the first is the plainest.
const std::vector<Filming>& filmings();

/// Grey levels of a frame before noise, CV_32F.
cv::Mat filmed_levels(const FilmedSkin& skin, const Filming& filming, int frame);

/// How the tracker did.
struct TrackingScore {
  std::string skin, filming;
  int started = 0, off_skin = 0;
  int expected = 0;      ///< observations after the first frame of points that no disc is near
  int observations = 0;  ///< made
  double kept = 0;       ///< share of the tracks that are ok in the last frame
  double rms_px = 0;     ///< per axis, without gross ones
  double bias_px = 0;    ///< length of the mean error, without gross ones
  int gross = 0;         ///< more than 1 px off
  /// Root of the mean of eᵀ Σ⁻¹ e / 2: of all but gross ones, and of all.
  double normalised = 0, normalised_all = 0;
  double sigma_px = 0;                                 ///< median stated, per axis
  double noise_grey = 0, jitter_px = 0, exposure = 0;  ///< as the tracker reports them
  std::array<int, fitting::kNumRefusals> refusals{};
  int template_updates = 0, redetected = 0;
};

/// Films into a new folder in `folder` (stills or a video, removed afterwards), tracks with `options` (seeds and masks are set here)
/// and compares with the truth. Throws InputError.
TrackingScore score_filming(const FilmedSkin& skin, const Filming& filming, fitting::TrackerOptions options,
                            unsigned seed, const std::string& folder);

/// "flow 3, residual 12"; "-" when none was refused.
std::string refusals_text(const TrackingScore& score);

}  // namespace rhytid::tools
