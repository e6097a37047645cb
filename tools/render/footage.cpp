#include "tools/render/footage.h"

#include <opencv2/imgproc.hpp>

#include "sim/core/error.h"

namespace rhytid::tools {

FootageWriter::FootageWriter(std::string path, const std::string& codec, double frames_per_second, int width,
                             int height)
    : path_(std::move(path)), file_(path_) {
  const bool is_jpeg = codec == "mjpg";
  if (!is_jpeg && (width % 2 != 0 || height % 2 != 0))
    throw InputError(path_, std::to_string(width) + " x " + std::to_string(height) + " px",
                     "even sizes, since H.264 needs them (or codec mjpg)");
  const int code =
      is_jpeg ? cv::VideoWriter::fourcc('M', 'J', 'P', 'G') : cv::VideoWriter::fourcc('a', 'v', 'c', '1');
  const int back_end = is_jpeg ? cv::CAP_OPENCV_MJPEG : cv::CAP_FFMPEG;
  if (!writer_.open(file_.path(), back_end, code, frames_per_second, {width, height}) || !writer_.isOpened())
    throw InputError(
        path_, "no working encoder for " + codec,
        is_jpeg ? "a writable folder"
                : "a writable folder and OpenCV with FFmpeg and an H.264 encoder, or /render/codec mjpg");
  if (is_jpeg) writer_.set(cv::VIDEOWRITER_PROP_QUALITY, 98);
}

void FootageWriter::add(const Image& rgb) {
  require(rgb.channels() == 3, "FootageWriter: an RGB picture is needed");
  const cv::Mat view(rgb.height(), rgb.width(), CV_8UC3, const_cast<std::uint8_t*>(rgb.pixels().data()));
  cv::Mat bgr;
  cv::cvtColor(view, bgr, cv::COLOR_RGB2BGR);
  writer_.write(bgr);
}

void FootageWriter::commit() {
  writer_.release();
  file_.commit();
}

}  // namespace rhytid::tools
