// Pyramidal Lucas-Kanade flow between two frames, made indifferent to slow light, with its own cross-check.
// Tests: tests/fitting/tracking/tracker_test.cpp
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

/// What optical flow says about one point.
struct FlowGuess {
  Vec2 pixel;                      ///< in the second frame
  double forward_backward_px = 0;  ///< distance from the start after flowing there and back
  bool found = false;
};

using FlowPyramid = std::vector<cv::Mat>;

/// Pyramid of (I − local mean) / local deviation, because flow compares raw values. grey: CV_32F, 0..255.
FlowPyramid flow_pyramid(const cv::Mat& grey, int window_px, int levels);

/// Flow of each of `points` from one frame to the next and back, in their order.
std::vector<FlowGuess> flow(const FlowPyramid& from, const FlowPyramid& to, const std::vector<Vec2>& points,
                            int window_px, int levels);

}  // namespace rhytid::fitting
