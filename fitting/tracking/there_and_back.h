// The check that drift cannot hide from: points followed through the whole footage are followed back again.
// Tests: tests/fitting/tracking/there_and_back_test.cpp
#pragma once

#include <optional>
#include <string>

#include "fitting/tracking/tracker.h"

namespace rhytid::fitting {

/// How far from its start a point ends that was followed to the last frame and from there back to the first,
/// each way aligned with a template of its own first frame. It shows drift: slipping to other texture, and
/// what renewed templates add up. It is blind to what both ways have in common: where no template was
/// renewed, both compare the same two pictures, so that their noise cancels, and so does a misfit of the warp
/// model that is the same in both directions. So it is a check from below; covariances are another matter.
struct ThereAndBack {
  int sent = 0;          ///< points that were followed in the last frame
  int returned = 0;      ///< of these, followed back to the first frame
  double median_px = 0;  ///< distance from the start, over the points that returned; 0 without any
  double p90_px = 0;     ///< of the same, that of the ninth decile
};

/// One plain line for a terminal or a report.
std::string summary(const ThereAndBack& result);

/// Follows the points of `forward`, which are tracks of `footage` made with `options`, from the last frame
/// that they reached to the first. Takes as long as making them. Nothing when the progress callback stops it.
/// Throws InputError as track() does, and for a video whose container does not say how long it is.
std::optional<ThereAndBack> there_and_back(const FrameSourceOptions& footage, const TrackSet& forward,
                                           TrackerOptions options);

}  // namespace rhytid::fitting
