// Where to start tracks: corners spread over a region of interest, a regular grid, or given points.
// Tests: tests/fitting/tracking/frame_source_test.cpp (Seeds)
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

enum class Seeding {
  corners,  ///< strong structure tensor (Shi and Tomasi 1994), spread evenly over the region
  grid,     ///< every grid_step_px in x and y
  points,   ///< the list given
};

struct SeedOptions {
  Seeding seeding = Seeding::corners;
  std::vector<Vec2> points;      ///< px; for Seeding::points
  int max_tracks = 400;          ///< corners only
  double min_distance_px = 10;   ///< corners only
  double quality = 0.005;        ///< corners only: smallest eigenvalue relative to the strongest corner's
  int grid_step_px = 20;         ///< grid only
  cv::Rect region;               ///< px; empty = the whole image
  cv::Mat region_mask;           ///< CV_8U, non-zero = allowed, size of the frames; empty = everywhere
  std::string region_mask_file;  ///< the same as an image file
};

/// Points for new tracks in `grey` (CV_32F, 0..255), at least `margin_px` inside the image and where
/// `forbidden` (CV_8U or empty) is zero. Corners are whole pixels: a material point need not sit on the
/// corner itself, and a window cut at whole pixels carries no interpolation error. Ordered by y, then x;
/// given points keep their order and are not filtered. Throws InputError on options out of range or a mask of
/// another size.
std::vector<Vec2> choose_seeds(const cv::Mat& grey, const cv::Mat& forbidden, int margin_px,
                               const SeedOptions& options);

}  // namespace rhytid::fitting
