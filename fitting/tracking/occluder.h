// What covers the skin: a mask per frame that tells the tracker where not to look.
// Tests: tests/fitting/tracking/tracker_test.cpp (OccludedByColour, OccludedByPolygon)
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "fitting/tracking/frame_source.h"

namespace rhytid::fitting {

/// Pixels whose colour lies in a box of hue, saturation and value, for a finger cot, glove or painted nail.
struct OccluderColour {
  cv::Scalar hsv_low,
      hsv_high;  ///< OpenCV 8-bit HSV: hue 0..180, saturation and value 0..255; hue may wrap (low > high)
};

struct OccluderOptions {
  std::vector<std::vector<cv::Point2f>> polygons;  ///< px, the same in all frames
  std::optional<OccluderColour> colour;
  int margin_px = 3;  ///< the mask is grown by this: its edge is blurred and casts shadow
};

/// CV_8U mask of the frame, 255 = covered; empty when nothing is asked for. Throws InputError on bad options.
cv::Mat occluder_mask(const Frame& frame, const OccluderOptions& options);

}  // namespace rhytid::fitting
