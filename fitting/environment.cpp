#include "fitting/environment.h"

#include <ceres/version.h>
#include <embree3/rtcore_config.h>
#include <nlopt.h>
#include <unistd.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>

namespace rhytid::fitting {

std::vector<LibraryVersion> library_versions() {
  int major = 0, minor = 0, bugfix = 0;
  nlopt_version(&major, &minor, &bugfix);
  const std::string nlopt =
      std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(bugfix);
  return {{"Ceres", CERES_VERSION_STRING},
          {"NLopt", nlopt},
          {"OpenCV", cv::getVersionString()},
          {"Embree", RTC_VERSION_STRING}};
}

std::vector<std::string> video_backends() {
  std::vector<std::string> names;
  for (const cv::VideoCaptureAPIs api : cv::videoio_registry::getBackends()) {
    names.push_back(cv::videoio_registry::getBackendName(api));
  }
  return names;
}

bool video_writer_opens(const std::string& four_characters, const std::string& suffix) {
  if (four_characters.size() != 4) return false;
  std::error_code ignored;
  const auto folder = std::filesystem::temp_directory_path(ignored);
  if (ignored) return false;
  const auto file = folder / ("rhytid-doctor-" + std::to_string(getpid()) + suffix);
  bool opened = false;
  try {
    const int code = cv::VideoWriter::fourcc(four_characters[0], four_characters[1], four_characters[2],
                                             four_characters[3]);
    cv::VideoWriter writer(file.string(), cv::CAP_FFMPEG, code, 24, cv::Size(64, 48));
    opened = writer.isOpened();
    if (opened) writer.write(cv::Mat::zeros(48, 64, CV_8UC3));
  } catch (const cv::Exception&) {
    opened = false;
  }
  std::filesystem::remove(file, ignored);
  return opened;
}

}  // namespace rhytid::fitting
