// Everything a report is made from: the record of the fit and, as far as the files are still there, scene,
// camera and footage.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "fitting/cameras.h"
#include "fitting/fit_result.h"
#include "sim/output/image.h"
#include "sim/scene/scene_model.h"

namespace rhytid::tools {

/// What one camera saw of one clip, and how well it is predicted.
struct SeenClip {
  std::string title;  ///< "left" or "left, camera 2"; empty where there is but one
  std::vector<fitting::FitResidual> residuals;
  std::optional<fitting::Camera> camera;
  std::string footage;  ///< that exists; empty when none does

  /// Frames with residuals: the last one that has at least half as many as the fullest; −1 without residuals.
  int late_frame() const;
};

struct ReportData {
  std::string folder;
  fitting::FitResult fit;
  std::string scene_file;                   ///< that was read; empty when none could be
  std::unique_ptr<const SceneModel> model;  ///< of the scene at the fitted values, or null
  std::optional<fitting::Camera> camera;
  std::string footage;                ///< that exists; empty when none does
  std::vector<std::string> left_out;  ///< sentences: what the report lacks and why

  /// One per clip and camera, in the order of the fit; the first is that of model, camera and footage.
  std::vector<SeenClip> seen;

  int late_frame() const { return seen.front().late_frame(); }
};

/// Reads fit.json and residuals.csv of `folder` (throws InputError without them) and what they name. Files
/// are looked for as written (relative to `folder`), then by their name in `folder`. The scene is that which
/// was fitted, settings included, at the fitted values.
ReportData gather_report_data(const std::string& folder);

/// A frame of the footage, BGR; nothing when the footage cannot be read that far.
std::optional<cv::Mat> footage_frame(const std::string& footage, int frame);

/// JPEG of a BGR picture, for photographs; PNG is for drawings.
std::string encode_jpeg(const cv::Mat& bgr);

}  // namespace rhytid::tools
