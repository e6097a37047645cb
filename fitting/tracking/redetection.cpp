#include "fitting/tracking/redetection.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace rhytid::fitting {
namespace {

/// Values of `image` at centre + gradient ξ for the integer offsets |ξ| <= outer; empty where it leaves the image.
cv::Mat straightened(const SplineImage& image, const PatchWarp& warp, int outer) {
  for (const double sx : {-outer, outer})
    for (const double sy : {-outer, outer}) {
      const Vec2 corner = warp.centre + warp.gradient * Vec2(sx, sy);
      if (!image.contains(corner.x(), corner.y())) return {};
    }
  cv::Mat values(2 * outer + 1, 2 * outer + 1, CV_32F);
  for (int y = -outer; y <= outer; ++y)
    for (int x = -outer; x <= outer; ++x) {
      const Vec2 at = warp.centre + warp.gradient * Vec2(x, y);
      values.at<float>(y + outer, x + outer) = static_cast<float>(image.sample(at.x(), at.y()).value);
    }
  return values;
}

/// Offset of the best correlation of `patch` with windows of `area`, from the middle.
Vec2 best_offset(const cv::Mat& area, const PatchTemplate& patch) {
  const int side = 2 * patch.half + 1;
  cv::Mat wanted(side, side, CV_32F), score;
  std::copy(patch.values.begin(), patch.values.end(), wanted.begin<float>());
  cv::matchTemplate(area, wanted, score, cv::TM_CCOEFF_NORMED);
  cv::Point best;
  cv::minMaxLoc(score, nullptr, nullptr, nullptr, &best);
  return Vec2(best.x, best.y) - Vec2::Constant((area.cols - side) / 2);
}

/// How far from its seed the window at `found` (deformation since the first frame) ends in the first frame; infinity where it
/// does not end anywhere.
double distance_back(const Follower& f, const PatchWarp& found, const FrameView& view,
                     const TrackerOptions& o) {
  constexpr double kNowhere = std::numeric_limits<double>::infinity();
  const int half = f.patch.half;
  const int reach =
      std::min({static_cast<int>(std::ceil(o.redetect_search_px)),
                static_cast<int>(std::min({f.seed.x(), f.seed.y(), view.first->cols() - 3 - f.seed.x(),
                                           view.first->rows() - 3 - f.seed.y()})) -
                    half - 1});
  const cv::Mat window = straightened(*view.image, found, half);
  const cv::Mat area =
      straightened(*view.first, {f.seed, Eigen::Matrix2d::Identity()}, half + std::max(reach, 0));
  if (window.empty() || area.empty()) return kNowhere;
  const PatchTemplate patch = make_template({window.begin<float>(), window.end<float>()}, half);
  if (!(patch.deviation > 0)) return kNowhere;
  FrameView back = view;
  back.image = view.first;
  const PatchWarp start{f.seed + best_offset(area, patch), Eigen::Matrix2d::Identity()};
  Alignment a;
  if (try_align(patch, start, start.gradient, 1 + o.max_correction_px, back, o, o.min_correlation, &a) !=
      Refusal::none)
    return kNowhere;
  return (a.warp.centre - f.seed).norm();
}

}  // namespace

Measurement redetect(const Follower& f, const PatchWarp& expected, const FrameView& view,
                     const TrackerOptions& o) {
  Measurement m;
  const int half = f.patch.half, reach = static_cast<int>(std::ceil(o.redetect_search_px));
  m.refusal = Refusal::occluded;
  if (covered_fraction(*view.mask, expected.centre, half) > 0.5) return m;  // the rest is not worth a search
  // Undo the expected deformation, so that the search is over translations only.
  const Eigen::Matrix2d gradient = expected.gradient * f.template_gradient.inverse();
  const cv::Mat area = straightened(*view.image, {expected.centre, gradient}, half + reach);
  m.refusal = Refusal::outside;
  if (area.empty()) return m;
  const Vec2 start = expected.centre + gradient * best_offset(area, f.patch);
  m.refusal = Refusal::occluded;
  if (covered_fraction(*view.mask, start, half) > o.max_covered_fraction) return m;
  // Whole pixels were searched, so the alignment may move by one on top of what the flow would be allowed.
  m.refusal = try_align(f.patch, {start, gradient}, gradient, 1 + o.max_correction_px, view, o,
                        o.redetect_min_correlation, &m.alignment);
  if (m.refusal == Refusal::none && residual_jumped(f, m.alignment, f.baseline, view, o))
    m.refusal = Refusal::residual;
  if (m.refusal != Refusal::none) return m;
  const PatchWarp found{m.alignment.warp.centre, m.alignment.warp.gradient * f.template_gradient};
  if (!(distance_back(f, found, view, o) <= o.redetect_max_return_px)) m.refusal = Refusal::forward_backward;
  return m;
}

}  // namespace rhytid::fitting
