#include "fitting/tracking/occluder.h"

#include <opencv2/imgproc.hpp>

#include "sim/core/error.h"

namespace rhytid::fitting {

cv::Mat occluder_mask(const Frame& frame, const OccluderOptions& options) {
  if (options.polygons.empty() && !options.colour) return {};
  if (options.margin_px < 0)
    throw InputError("occluder: margin_px", std::to_string(options.margin_px), "0 or more px");
  cv::Mat mask = cv::Mat::zeros(frame.grey.size(), CV_8U);
  for (const auto& polygon : options.polygons) {
    if (polygon.size() < 3)
      throw InputError("occluder: polygons", std::to_string(polygon.size()) + " corners",
                       "3 or more corners");
    std::vector<cv::Point> corners;
    for (const cv::Point2f& p : polygon) corners.emplace_back(cvRound(p.x), cvRound(p.y));
    cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{corners}, cv::Scalar(255));
  }
  if (options.colour) {
    cv::Mat hsv, part;
    cv::cvtColor(frame.colour, hsv, cv::COLOR_BGR2HSV);
    const cv::Scalar &low = options.colour->hsv_low, &high = options.colour->hsv_high;
    if (low[0] <= high[0]) {
      cv::inRange(hsv, low, high, part);
      mask |= part;
    } else {  // red: the hue interval passes through 180 = 0
      cv::inRange(hsv, low, cv::Scalar(180, high[1], high[2]), part);
      mask |= part;
      cv::inRange(hsv, cv::Scalar(0, low[1], low[2]), high, part);
      mask |= part;
    }
  }
  if (options.margin_px > 0) {
    const int side = 2 * options.margin_px + 1;
    cv::dilate(mask, mask, cv::getStructuringElement(cv::MORPH_ELLIPSE, {side, side}));
  }
  return mask;
}

}  // namespace rhytid::fitting
