#include "fitting/tracking/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;

double deviation(const Observation& o) {
  return std::sqrt(o.covariance.trace() / 2);
}

/// The 95 % quantile of the deviations, rounded up to 1, 2 or 5 times a power of ten.
double automatic_scale(const TrackSet& tracks) {
  std::vector<double> all;
  for (const Track& t : tracks.tracks)
    for (const Observation& o : t.observations)
      if (o.status == TrackStatus::ok) all.push_back(deviation(o));
  if (all.empty()) return 1;
  const auto nth = all.begin() + static_cast<std::ptrdiff_t>(0.95 * (all.size() - 1));
  std::nth_element(all.begin(), nth, all.end());
  const double decade = std::pow(10, std::floor(std::log10(std::max(*nth, 1e-6))));
  for (double step : {1.0, 2.0, 5.0})
    if (*nth <= step * decade) return step * decade;
  return 10 * decade;
}

/// Blue over green to red, BGR.
cv::Scalar colour_of(double fraction) {
  const double f = std::clamp(fraction, 0.0, 1.0);
  const auto ramp = [](double distance) { return 255 * std::clamp(1.5 - 4 * std::abs(distance), 0.0, 1.0); };
  return {ramp(f - 0.125), ramp(f - 0.5), ramp(f - 0.875)};
}

class Painter {
 public:
  Painter(const TrackSet& tracks, const std::string& camera, const OverlayOptions& options)
      : options_(options),
        full_(options.full_scale_px > 0 ? options.full_scale_px : automatic_scale(tracks)) {
    for (const Track& t : tracks.tracks)
      if (t.camera == camera) tracks_.push_back(&t);
  }

  cv::Mat paint(const Frame& frame) const {
    cv::Mat canvas;
    cv::resize(frame.colour, canvas, {}, options_.scale, options_.scale, cv::INTER_CUBIC);
    int seen = 0;
    for (const Track* t : tracks_) seen += paint_track(*t, frame.index, &canvas);
    char text[120];
    std::snprintf(text, sizeof text, "frame %d  %d tracks  red = %.3g px", frame.index, seen, full_);
    cv::putText(canvas, text, {6, 16}, cv::FONT_HERSHEY_SIMPLEX, 0.42, {0, 0, 0}, 3, cv::LINE_AA);
    cv::putText(canvas, text, {6, 16}, cv::FONT_HERSHEY_SIMPLEX, 0.42, {255, 255, 255}, 1, cv::LINE_AA);
    // H.264 wants even sides.
    cv::copyMakeBorder(canvas, canvas, 0, canvas.rows % 2, 0, canvas.cols % 2, cv::BORDER_REPLICATE);
    return canvas;
  }

 private:
  /// Sub-pixel drawing: coordinates in 1/16 px, pixel centres of the small image mapped into the large one.
  cv::Point place(const Vec2& pixel) const {
    const Vec2 p = 16 * (options_.scale * (pixel + Vec2::Constant(0.5)) - Vec2::Constant(0.5));
    return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
  }

  bool paint_track(const Track& track, int frame, cv::Mat* canvas) const {
    const Observation* now = track.at(frame);
    if (now == nullptr) return false;
    const auto index = static_cast<std::size_t>(now - track.observations.data());
    if (now->status != TrackStatus::ok) {
      if (index > 0 && track.observations[index - 1].status == TrackStatus::ok) {
        const cv::Point p = place(track.observations[index - 1].pixel) / 16;
        cv::drawMarker(*canvas, p, {255, 0, 255}, cv::MARKER_TILTED_CROSS, 7, 1, cv::LINE_AA);
      }
      return false;
    }
    const cv::Scalar colour = colour_of(deviation(*now) / full_);
    for (std::size_t i = index; i > 0 && index - i < static_cast<std::size_t>(options_.trail_frames); --i) {
      if (track.observations[i - 1].status != TrackStatus::ok) break;
      cv::line(*canvas, place(track.observations[i - 1].pixel), place(track.observations[i].pixel), colour, 1,
               cv::LINE_AA, 4);
    }
    cv::circle(*canvas, place(now->pixel), 2 * 16, colour, cv::FILLED, cv::LINE_AA, 4);
    return true;
  }

  OverlayOptions options_;
  double full_;
  std::vector<const Track*> tracks_;
};

struct Encoder {
  const char* codec;
  const char* extension;
  int back_end;
};

}  // namespace

OverlayReport write_overlay(FrameSource& source, const TrackSet& tracks, const std::string& camera,
                            const std::string& path, const OverlayOptions& options) {
  if (options.scale < 1 || options.scale > 8)
    throw InputError("overlay: scale", std::to_string(options.scale), "1 to 8");
  const Painter painter(tracks, camera, options);
  std::optional<Frame> frame = source.next();
  if (!frame) throw InputError(path, "no frame to draw on", "footage with at least one frame");
  cv::Mat canvas = painter.paint(*frame);

  const fs::path base = fs::path(path).replace_extension();
  for (const Encoder& encoder :
       {Encoder{"avc1", ".mp4", cv::CAP_FFMPEG}, Encoder{"MJPG", ".avi", cv::CAP_OPENCV_MJPEG}}) {
    const std::string final_path = base.string() + encoder.extension;
    AtomicPath file(final_path);
    cv::VideoWriter writer;
    const char* c = encoder.codec;
    if (!writer.open(file.path(), encoder.back_end, cv::VideoWriter::fourcc(c[0], c[1], c[2], c[3]),
                     source.frames_per_second(), canvas.size()) ||
        !writer.isOpened())
      continue;
    OverlayReport report{final_path, encoder.codec, 0};
    for (; frame; frame = source.next()) {
      writer.write(painter.paint(*frame));
      ++report.frames;
    }
    writer.release();
    file.commit();
    return report;
  }
  throw InputError(path, "no working video encoder",
                   "OpenCV with FFmpeg (H.264) or Motion JPEG, and a writable folder");
}

}  // namespace rhytid::fitting
