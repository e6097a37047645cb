// A video file that appears only when it is complete.
#pragma once

#include <opencv2/videoio.hpp>
#include <string>

#include "sim/output/atomic_file.h"
#include "sim/output/image.h"

namespace rhytid::tools {

class FootageWriter {
 public:
  /// Codec "mjpg" (Motion JPEG in .avi, least loss) or "h264" (.mp4). Throws InputError when the file or the
  /// encoder cannot be opened, and for h264 on odd sizes.
  FootageWriter(std::string path, const std::string& codec, double frames_per_second, int width, int height);

  void add(const Image& rgb);
  /// Closes the file under its real name. Throws InputError when nothing arrived on the disk.
  void commit();

 private:
  std::string path_;
  AtomicPath file_;
  cv::VideoWriter writer_;  // after file_: closed before the temporary file is removed
};

}  // namespace rhytid::tools
