#include "tools/finger_files.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "fitting/finger_outline.h"
#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid::tools {
namespace {

const cv::Scalar kBlue(230, 120, 40), kGreen(60, 220, 60), kRed(40, 40, 230);

cv::Point sixteenths(const Vec2& p) {  // OpenCV draws at 1/16 px
  return {cvRound(16 * std::clamp(p.x(), -1e4, 1e5)), cvRound(16 * std::clamp(p.y(), -1e4, 1e5))};
}

void draw_place(cv::Mat& picture, const fitting::Camera& camera, const Vec3& centre,
                const ColliderScene& collider, const cv::Scalar& colour) {
  constexpr int kShift = 4;
  if (collider.shape != ShapeKind::sphere) {
    const Vec2 p = camera.project(centre);
    if (p.allFinite())
      cv::drawMarker(picture, sixteenths(p) / 16, colour, cv::MARKER_CROSS, std::max(9, picture.cols / 50), 1,
                     cv::LINE_AA);
    return;
  }
  std::vector<cv::Point> corners;
  for (const fitting::OutlinePoint& p : fitting::sphere_outline(centre, collider.radius, camera, 180))
    corners.push_back(sixteenths(p.pixel));
  if (!corners.empty()) cv::polylines(picture, corners, true, colour, 1, cv::LINE_AA, kShift);
}

}  // namespace

cv::Mat drawn_finger(const cv::Mat& colour, const FingerFrame& frame, const fitting::Camera& camera,
                     const ColliderScene& collider) {
  cv::Mat picture = colour.clone();
  draw_place(picture, camera, frame.of_scene.centre, collider, kBlue);
  if (frame.lost.empty()) draw_place(picture, camera, frame.found.centre, collider, kGreen);
  for (const FingerSign& sign : frame.signs)
    cv::circle(picture, sixteenths(sign.pixel) / 16, std::max(1, picture.cols / 400),
               sign.fits ? kGreen : kRed, cv::FILLED, cv::LINE_AA);
  const std::string text = "frame " + std::to_string(frame.index) + (frame.lost.empty() ? "" : ": lost");
  for (const int width : {3, 1})
    cv::putText(picture, text, {8, picture.rows - 10}, cv::FONT_HERSHEY_SIMPLEX,
                std::max(0.5, picture.cols / 1200.0), width == 3 ? cv::Scalar::all(0) : cv::Scalar::all(255),
                width, cv::LINE_AA);
  return picture;
}

std::string tiled_png(std::vector<cv::Mat> pictures, const std::string& folder) {
  if (pictures.size() % 2 == 1 && pictures.size() > 1)
    pictures.push_back(cv::Mat::zeros(pictures.front().size(), pictures.front().type()));
  cv::Mat all = pictures.front();
  if (pictures.size() > 1) {
    std::vector<cv::Mat> rows;
    for (std::size_t i = 0; i + 1 < pictures.size(); i += 2) {
      cv::Mat row;
      cv::hconcat(pictures[i], pictures[i + 1], row);
      rows.push_back(row);
    }
    cv::vconcat(rows, all);
  }
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", all, png))
    throw InputError(folder, "no picture", "a picture that can be written");
  return {png.begin(), png.end()};
}

std::string path_text(const std::vector<FingerFrame>& frames, bool turns) {
  std::string text;
  for (const FingerFrame& f : frames) {
    if (!f.lost.empty()) continue;
    text += exact_text(f.time);
    for (int k = 0; k < 3; ++k) text += "," + exact_text(f.found.centre[k]);
    if (turns) {
      const Eigen::Quaterniond q(f.found.rotation);
      for (const double part : {q.w(), q.x(), q.y(), q.z()}) text += "," + exact_text(part);
    }
    for (const Mat3* covariance : {&f.own, &f.shared})
      for (int a = 0; a < 3; ++a)
        for (int b = a; b < 3; ++b) text += "," + short_text((*covariance)(a, b), 9);
    text += "\n";
  }
  if (text.empty()) return text;
  std::string header = turns ? "time,x,y,z,qw,qx,qy,qz" : "time,x,y,z";
  for (const char* what : {"own", "shared"})
    for (const char* pair : {"xx", "xy", "xz", "yy", "yz", "zz"})
      header += std::string(",") + what + "_" + pair;
  return header + "\n" + text;
}

FingerSummary summary_of(const std::vector<FingerFrame>& frames) {
  FingerSummary s;
  for (const FingerFrame& f : frames) {
    if (!f.lost.empty()) {
      ++s.lost;
      continue;
    }
    ++s.found;
    const double off = (f.found.centre - f.of_scene.centre).norm();
    s.off_rms += off * off;
    s.off_largest = std::max(s.off_largest, off);
    s.rms_px += f.rms * f.rms;
    s.across_sigma = std::max(s.across_sigma, f.across_sigma);
    s.depth_sigma = std::max(s.depth_sigma, f.depth_sigma);
  }
  const double n = std::max(1, s.found);
  s.off_rms = std::sqrt(s.off_rms / n);
  s.rms_px = std::sqrt(s.rms_px / n);
  return s;
}

nlohmann::ordered_json finger_json(const std::vector<FingerFrame>& frames, const ColliderScene& collider,
                                   const nlohmann::ordered_json& more) {
  using nlohmann::ordered_json;
  const auto list = [](const Vec3& v) { return ordered_json{v[0], v[1], v[2]}; };
  const FingerSummary summary = summary_of(frames);
  ordered_json rows = ordered_json::array();
  for (const FingerFrame& f : frames) {
    ordered_json& row = rows.emplace_back(ordered_json{{"frame", f.index},
                                                       {"time_s", f.time},
                                                       {"scene_mm", list(f.of_scene.centre)},
                                                       {"lost", !f.lost.empty()}});
    if (f.lost.empty()) {
      row["centre_mm"] = list(f.found.centre);
      row["sigma_mm"] = list(f.covariance.diagonal().cwiseSqrt());
      row["across_sigma_mm"] = f.across_sigma;
      row["depth_sigma_mm"] = f.depth_sigma;
      row["rms_px"] = f.rms;
    } else {
      row["why"] = f.lost;
    }
    row.update(f.more);
  }
  ordered_json record = {{"collider", collider.name}};
  record.update(more);
  record["lost"] = summary.lost;
  record["off_scene_rms_mm"] = summary.off_rms;
  record["off_scene_max_mm"] = summary.off_largest;
  record["frames"] = rows;
  return record;
}

}  // namespace rhytid::tools
