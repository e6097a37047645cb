#include "tools/render/scene_masks.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "tools/render/skin_renderer.h"

namespace rhytid::tools {

cv::Mat patch_mask(const MovingSurface& surface, const fitting::Camera& camera, int inset_px) {
  const SubdividedSurface tessellation(surface.mesh, SurfaceSide::outer, subdivision_for(surface, camera, 8));
  const MatrixX3 rest = tessellation.positions({});
  // A border, so that the edge of the picture does not count as an edge of the patch.
  const int border = inset_px + 1;
  cv::Mat mask = cv::Mat::zeros(camera.height + 2 * border, camera.width + 2 * border, CV_8U);
  for (const auto& triangle : tessellation.triangles()) {
    std::vector<cv::Point> corners;
    for (const int vertex : triangle) {
      const Vec2 p = camera.project(rest.row(vertex).transpose());
      if (!p.allFinite() || p.cwiseAbs().maxCoeff() > 30000) break;
      corners.emplace_back(cvRound(p.x()) + border, cvRound(p.y()) + border);
    }
    if (corners.size() == 3) cv::fillConvexPoly(mask, corners, cv::Scalar(255));
  }
  const int side = 2 * inset_px + 1;
  if (inset_px > 0) cv::erode(mask, mask, cv::Mat::ones(side, side, CV_8U));
  return mask(cv::Rect(border, border, camera.width, camera.height)).clone();
}

cv::Mat finger_mask(const Scene& scene, double time, const Vec3& direction, const fitting::Camera& camera,
                    double margin_px) {
  cv::Mat mask = cv::Mat::zeros(camera.height, camera.width, CV_8U);
  for (const Finger& finger : fingers_at(scene, time, direction)) {
    std::vector<cv::Point> corners;
    for (const cv::Point2f& p : finger_outline(finger, camera, margin_px))
      corners.emplace_back(cvRound(p.x), cvRound(p.y));
    if (corners.size() >= 3) cv::fillConvexPoly(mask, corners, cv::Scalar(255));
  }
  return mask;
}

}  // namespace rhytid::tools
