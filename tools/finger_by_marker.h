// `rhytid finger --marker`: tracks the points of a marker through the footage and makes a path of them.
// Tests: tests/tools/finger_marker_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/case.h"
#include "fitting/finger_marker.h"
#include "fitting/tracking/frame_source.h"
#include "tools/finger_files.h"
#include "tools/progress.h"

namespace rhytid::tools {

struct MarkerJob {
  std::string file;          ///< the CSV
  double sigma = 1;          ///< px, of points that have none of their own
  fitting::TrackCase track;  ///< window and model
  fitting::MarkerOptions options;
};

struct MarkerFinding {
  std::vector<FingerFrame> frames;  ///< those that the footage has
  bool turns = false;               ///< rotations were found
  int asked = 0;                    ///< frames
  bool interrupted = false;
  fitting::TrackSet tracks;
  nlohmann::ordered_json record;  ///< of the points, for the head of finger.json
  std::vector<std::string> doubts;
  double own_sigma = 0;  ///< mm, largest of what a frame errs by itself, in any direction
};

/// Reads the marker, which must lie in a picture of the footage's size. Throws InputError naming file and line.
std::vector<fitting::Landmark> read_marker_in(const MarkerJob& job, const fitting::Camera& camera);

/// `of_scene` by frame, with the clock of the path. Warns of frames that are lost and points that are not tracked.
MarkerFinding find_by_marker(const MarkerJob& job, const std::vector<fitting::Landmark>& marker,
                             fitting::FrameSource& source, const fitting::Camera& camera,
                             const std::vector<FingerFrame>& of_scene, Progress& progress);

}  // namespace rhytid::tools
