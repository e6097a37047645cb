#include "fitting/tracking/optical_flow.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace rhytid::fitting {
namespace {

/// Removes slow light from the image, because optical flow compares raw values: (I − local mean)/local
/// deviation.
cv::Mat flatten_lighting(const cv::Mat& grey, int window) {
  const cv::Size box(2 * window + 1, 2 * window + 1);
  cv::Mat mean, square, deviation, out;
  cv::boxFilter(grey, mean, CV_32F, box, {-1, -1}, true, cv::BORDER_REFLECT);
  cv::boxFilter(grey.mul(grey), square, CV_32F, box, {-1, -1}, true, cv::BORDER_REFLECT);
  cv::sqrt(cv::max(square - mean.mul(mean), 0), deviation);
  // +2 grey: where there is less texture than that, noise must not be blown up to full scale. 40 grey per
  // deviation keeps three deviations inside 0..255.
  cv::Mat scaled = (grey - mean) / (deviation + 2.0f);
  scaled.convertTo(out, CV_8U, 40, 128);
  return out;
}

}  // namespace

FlowPyramid flow_pyramid(const cv::Mat& grey, int window_px, int levels) {
  FlowPyramid pyramid;
  cv::buildOpticalFlowPyramid(flatten_lighting(grey, window_px), pyramid, {window_px, window_px}, levels);
  return pyramid;
}

std::vector<FlowGuess> flow(const FlowPyramid& from, const FlowPyramid& to, const std::vector<Vec2>& points,
                            int window_px, int levels) {
  std::vector<FlowGuess> guesses;
  if (points.empty()) return guesses;
  std::vector<cv::Point2f> start, there, back;
  for (const Vec2& p : points) start.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  std::vector<uchar> found, found_back;
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 0.003);
  const cv::Size window(window_px, window_px);
  cv::calcOpticalFlowPyrLK(from, to, start, there, found, cv::noArray(), window, levels, stop, 0, 1e-5);
  cv::calcOpticalFlowPyrLK(to, from, there, back, found_back, cv::noArray(), window, levels, stop, 0, 1e-5);
  for (std::size_t i = 0; i < start.size(); ++i)
    guesses.push_back({{there[i].x, there[i].y},
                       std::hypot(back[i].x - start[i].x, back[i].y - start[i].y),
                       found[i] && found_back[i]});
  return guesses;
}

}  // namespace rhytid::fitting
