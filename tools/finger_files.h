// What `rhytid finger` found, frame by frame, and the files that say so: picture, path, record. The same for the
// outline and for a marker. Tests: tests/tools/finger_test.cpp
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "fitting/cameras.h"
#include "sim/scene/collider_motion.h"

namespace rhytid::tools {

/// Something seen in the picture, and whether it agrees with what was found.
struct FingerSign {
  Vec2 pixel = Vec2::Zero();
  bool fits = true;
};

/// What one frame says.
struct FingerFrame {
  int index = 0;
  double time = 0;  ///< s, on the clock of the path
  BodyPose of_scene;
  std::string lost;                          ///< why nothing was found; empty: it was
  BodyPose found;                            ///< turned as the scene says unless that was found too
  Mat3 covariance = Mat3::Zero();            ///< of the centre, mm²
  Mat3 own = Mat3::Zero();                   ///< of what this frame errs by itself, mm²
  Mat3 shared = Mat3::Zero();                ///< of what all frames err alike, mm²
  double across_sigma = 0, depth_sigma = 0;  ///< mm, across and along the line of sight
  double rms = 0;                            ///< px, of what is left
  std::vector<FingerSign> signs;
  nlohmann::ordered_json more = nlohmann::ordered_json::object();  ///< further keys of finger.json, by frame
};

/// The picture with the outline of the scene's path in blue, of what was found in green (spheres; other shapes: a
/// cross at the centre), and the signs: green, or red where they do not fit.
cv::Mat drawn_finger(const cv::Mat& colour, const FingerFrame& frame, const fitting::Camera& camera,
                     const ColliderScene& collider);

/// Pictures of one size as a PNG, two beside each other. At least one. Throws InputError naming `folder`.
std::string tiled_png(std::vector<cv::Mat> pictures, const std::string& folder);

/// As `path_file` reads it, rotations too if it `turns`, with the covariances that a fit reads
/// (fitting/path_deviations.h). Empty when all frames are lost.
std::string path_text(const std::vector<FingerFrame>& frames, bool turns);

/// Over the frames that were found; distances are from the scene's path.
struct FingerSummary {
  double off_rms = 0, off_largest = 0;       ///< mm
  double rms_px = 0;                         ///< px, of what is left
  double across_sigma = 0, depth_sigma = 0;  ///< mm, the largest
  int found = 0, lost = 0;
};
FingerSummary summary_of(const std::vector<FingerFrame>& frames);

/// finger.json; `more` are further keys of its head.
nlohmann::ordered_json finger_json(const std::vector<FingerFrame>& frames, const ColliderScene& collider,
                                   const nlohmann::ordered_json& more);

}  // namespace rhytid::tools
