// Skins whose every point's path through the picture is known exactly, for studies of the tracker: a plane with
// a texture that is pulled smoothly, or the skin of a simulated run. Pictures are linear light (0..1), at any time.
// Units  px, frames.   Tests  tests/tools/tracker_bench_test.cpp
#pragma once

#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "fitting/case.h"
#include "fitting/tracking/spline_image.h"
#include "fitting/tracking/tracker.h"
#include "tools/progress.h"
#include "tools/render/skin_renderer.h"

namespace rhytid::tools {

/// How the head rolls in the picture: x ↦ c + s(t) + zoom(t) R(t) (x − c). It moves fastest at t = 0. Swipes push all of it forth
/// and back from rest at t = 0, by swipe_px (1 − cos 2πt/swipe_period)/2 along (0.8, 0.6).
struct HeadRoll {
  Vec2 centre = Vec2::Zero();
  double shift_px = 0, turn = 0, zoom = 0;  ///< amplitudes: px, rad, share
  double period = 20;                       ///< frames
  double swipe_px = 0, swipe_period = 16;   ///< px, frames
  Vec2 forward(const Vec2& x, double t) const;
  Vec2 backward(const Vec2& x, double t) const;
};

class FilmedSkin {
 public:
  virtual ~FilmedSkin() = default;
  virtual cv::Size size() const = 0;
  virtual int frames() const = 0;
  /// Linear light at time t (frames; may be outside 0 .. frames − 1 by half a frame), CV_32F.
  virtual cv::Mat light(double t, const HeadRoll& head) const = 0;
  /// Where the point that is at `first` in frame 0 is in every frame; empty when it is not on the skin.
  virtual std::vector<Vec2> path(const Vec2& first, const HeadRoll& head) const = 0;
  /// Where points can be followed, and what covers them: seeds and masks.
  virtual void prepare(const HeadRoll& head, fitting::TrackerOptions* options) const = 0;
};

/// x = X + amplitude (1 − cos πt/T)/2 direction exp(−|X − c|²/2 reach²): a finger's pull at the picture's middle.
struct Pull {
  Vec2 centre = Vec2::Zero(), direction = Vec2(0.8, 0.6);
  double amplitude_px = 6, reach_px = 90, frames = 15;
  Vec2 forward(const Vec2& X, double t) const;
  Vec2 backward(const Vec2& x, double t) const;
};

/// A textured plane under a pull. `texture` is a picture in encoded grey levels (CV_32F, 0..255) of which
/// `scale` px are one of the film's; its middle is the film's.
std::unique_ptr<FilmedSkin> make_plane_skin(const cv::Mat& texture, double scale, cv::Size size, int frames,
                                            const cv::Rect& region);

/// Random Gaussian spots (radius 1.6 to 3 px of the film, standard deviation about 20 grey), two px to one of the film.
cv::Mat speckle_texture(cv::Size size, unsigned seed);

/// The truth of a case that one camera films, as `rhytid render` draws it; between frames of the run the
/// skin moves smoothly. Simulates unless `folder` has the motion. Nothing when interrupted. Throws InputError.
std::unique_ptr<FilmedSkin> make_twin_skin(const fitting::Case& c, int max_frames, const std::string& folder,
                                           Progress& progress);

/// Exponent of the film's encoding: grey = 255 light^(1/kGamma).
inline constexpr double kGamma = 2.2;

}  // namespace rhytid::tools
