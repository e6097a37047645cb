#include "fitting/tracking/seeds.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>
#include <utility>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

std::string px(cv::Size s) {
  return std::to_string(s.width) + " x " + std::to_string(s.height) + " px";
}

cv::Mat allowed_region(const cv::Mat& grey, const cv::Mat& forbidden, int margin, const SeedOptions& o) {
  const cv::Rect image(0, 0, grey.cols, grey.rows);
  if (grey.cols <= 2 * margin || grey.rows <= 2 * margin)
    throw InputError("tracker: image", px(grey.size()),
                     "more than twice the window margin of " + std::to_string(margin) + " px");
  cv::Rect inner(margin, margin, grey.cols - 2 * margin, grey.rows - 2 * margin);
  if (!o.region.empty()) {
    if ((o.region & image) != o.region)
      throw InputError(
          "tracker: region",
          px(o.region.size()) + " at " + std::to_string(o.region.x) + ", " + std::to_string(o.region.y),
          "a rectangle inside the image of " + px(grey.size()));
    inner &= o.region;
  }
  cv::Mat allowed = cv::Mat::zeros(grey.size(), CV_8U);
  if (!inner.empty()) allowed(inner).setTo(255);

  cv::Mat mask = o.region_mask;
  if (!o.region_mask_file.empty()) {
    mask = cv::imread(o.region_mask_file, cv::IMREAD_GRAYSCALE);
    if (mask.empty())
      throw InputError(o.region_mask_file, "an unreadable image", "a mask image, white = track here");
  }
  if (!mask.empty()) {
    const std::string where = o.region_mask_file.empty() ? "tracker: region_mask" : o.region_mask_file;
    if (mask.size() != grey.size())
      throw InputError(where, px(mask.size()), px(grey.size()) + " like the frames");
    if (mask.type() != CV_8U) throw InputError(where, "another pixel type", "8 bit grey");
    allowed.setTo(0, mask == 0);
  }
  if (!forbidden.empty()) allowed.setTo(0, forbidden);
  return allowed;
}

/// Keeps the best corners of every cell of a lattice, round by round, until there are enough: a few bright,
/// contrasty features must not take all tracks from the skin between them.
std::vector<cv::Point2f> spread(const std::vector<cv::Point2f>& by_strength, const cv::Mat& allowed,
                                int limit) {
  if (static_cast<int>(by_strength.size()) <= limit) return by_strength;
  const double cell = std::max(1.0, std::sqrt(static_cast<double>(cv::countNonZero(allowed)) / limit));
  std::map<std::pair<int, int>, int> taken;
  std::vector<std::tuple<int, int>> ranked;  // (rank inside the cell, index): strength breaks ties
  for (int i = 0; i < static_cast<int>(by_strength.size()); ++i)
    ranked.emplace_back(
        taken[{static_cast<int>(by_strength[i].x / cell), static_cast<int>(by_strength[i].y / cell)}]++, i);
  std::sort(ranked.begin(), ranked.end());
  std::vector<cv::Point2f> kept;
  for (int i = 0; i < limit; ++i) kept.push_back(by_strength[std::get<1>(ranked[i])]);
  return kept;
}

}  // namespace

std::vector<Vec2> choose_seeds(const cv::Mat& grey, const cv::Mat& forbidden, int margin_px,
                               const SeedOptions& o) {
  if (o.seeding == Seeding::points) {
    for (const Vec2& p : o.points)
      if (!p.allFinite()) throw InputError("tracker: points", "a value that is not finite", "finite px");
    return o.points;
  }
  const cv::Mat allowed = allowed_region(grey, forbidden, margin_px, o);
  std::vector<Vec2> seeds;
  if (o.seeding == Seeding::grid) {
    if (o.grid_step_px < 1)
      throw InputError("tracker: grid_step_px", std::to_string(o.grid_step_px), "1 or more");
    for (int y = o.region.y + margin_px; y < grey.rows; y += o.grid_step_px)
      for (int x = o.region.x + margin_px; x < grey.cols; x += o.grid_step_px)
        if (allowed.at<uchar>(y, x)) seeds.emplace_back(x, y);
    return seeds;
  }
  if (o.max_tracks < 1) throw InputError("tracker: max_tracks", std::to_string(o.max_tracks), "1 or more");
  if (!(o.min_distance_px >= 1))
    throw InputError("tracker: min_distance_px", std::to_string(o.min_distance_px), "1 or more");
  if (!(o.quality > 0 && o.quality < 1))
    throw InputError("tracker: quality", std::to_string(o.quality), "between 0 and 1");
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(grey, corners, 0, o.quality, o.min_distance_px, allowed, 5);
  for (const cv::Point2f& c : spread(corners, allowed, o.max_tracks)) seeds.emplace_back(c.x, c.y);
  std::sort(seeds.begin(), seeds.end(), [](const Vec2& a, const Vec2& b) {
    return std::make_tuple(a.y(), a.x()) < std::make_tuple(b.y(), b.x());
  });
  return seeds;
}

}  // namespace rhytid::fitting
