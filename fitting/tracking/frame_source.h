// Footage as a stream of frames: a video file or a sequence of stills, behind one interface.
// Tests: tests/fitting/tracking/frame_source_test.cpp
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace rhytid::fitting {

/// One frame. Grey values are on the 0..255 scale whatever the bit depth was.
struct Frame {
  int index = 0;      ///< position in the footage (first frame of the file or sequence = 0)
  double time_s = 0;  ///< start_time_s + index / rate
  cv::Mat grey;       ///< CV_32F, luma without rounding
  cv::Mat colour;     ///< CV_8UC3, BGR, for masks and overlays
};

struct FrameSourceOptions {
  /// A video file; or stills: a printf pattern ("f_%04d.png", numbered from 0 or 1 upwards without gaps), a glob ("*.tif",
  /// in natural order: 9 before 10), or a single image.
  std::string path;
  std::vector<std::string> images;  ///< instead of path: the stills, in order
  double frames_per_second = 0;  ///< 0 = the video's own rate; must be given for stills with a time meaning
  double start_time_s = 0;       ///< time of frame 0, s
  int first = 0;                 ///< first frame delivered
  int last = -1;                 ///< last frame delivered, −1 = to the end
  int step = 1;                  ///< deliver every step-th frame from `first`
  /// The same frames, the last one first. A video does not seek exactly: it is decoded in blocks that fit
  /// into 256 MB, each from the beginning of the file. Its length must be known.
  bool backwards = false;
};

/// Reads frames in order. Memory: one frame at a time (or a block, backwards).
class FrameSource {
 public:
  /// Throws InputError naming the path when nothing can be read or an option is out of range.
  explicit FrameSource(FrameSourceOptions options);
  ~FrameSource();
  FrameSource(FrameSource&&) noexcept;
  FrameSource& operator=(FrameSource&&) noexcept;

  /// The next frame, or nothing at the end (backwards: at the beginning). Throws InputError when a still is
  /// unreadable or changes size.
  std::optional<Frame> next();

  /// How many frames were asked for: by `last`, else by the length of the sequence or what the container
  /// says. A damaged video may deliver fewer; who reads must compare and say so.
  int frames_asked() const;

  double frames_per_second() const;  ///< 1 for stills without a given rate
  cv::Size size() const;             ///< px
  /// Smallest difference between two grey values of the files: 1 for 8 bit, 255/65535 for 16 bit.
  double quantum() const;
  const FrameSourceOptions& options() const { return options_; }
  /// The stills in order, or the one video file.
  std::vector<std::string> files() const;

 private:
  struct Reader;
  std::optional<Frame> next_forwards();
  std::optional<Frame> next_backwards();
  FrameSourceOptions options_;
  std::unique_ptr<Reader> reader_;
};

}  // namespace rhytid::fitting
