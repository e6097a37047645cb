// What the heavy libraries of the fitting part offer on this machine: versions, and whether video can be
// written.
#pragma once

#include <string>
#include <vector>

namespace rhytid::fitting {

struct LibraryVersion {
  std::string name, version;
};

/// Ceres, NLopt, OpenCV and Embree as compiled against or, where they can tell, as loaded.
std::vector<LibraryVersion> library_versions();

/// Names of OpenCV's video input and output backends, for example FFMPEG.
std::vector<std::string> video_backends();

/// Whether a video writer opens for the four-character code and container suffix (".mp4", ".avi"): writes one
/// small frame into the system's temporary folder and removes it. Never throws.
bool video_writer_opens(const std::string& four_characters, const std::string& suffix);

}  // namespace rhytid::fitting
