// Skin of known motion that the tracker's tests follow, its pictures, and a grid of points on it.
#pragma once

#include "fitting/tracking/tracker.h"
#include "speckle.h"

namespace rhytid::fitting::testing {

inline constexpr int kWidth = 200, kHeight = 160;

/// Drift, strain and rotation growing with the frame.
inline AffineMotion motion(int frame) {
  AffineMotion m;
  m.centre = {kWidth / 2.0, kHeight / 2.0};
  m.translation = Vec2(0.37, -0.23) * frame;
  m.gradient << 1 + 0.004 * frame, 0.002 * frame, -0.003 * frame, 1 - 0.002 * frame;
  return m;
}

inline cv::Mat picture(const Speckle& skin, const AffineMotion& m, double noise, unsigned seed,
                       double gain = 1, double bias = 0) {
  return skin.render([&](const Vec2& x) { return m.backward(x); }, noise, seed, gain, bias);
}

inline TrackerOptions small_grid() {
  TrackerOptions o;
  o.seeds.seeding = Seeding::grid;
  o.seeds.grid_step_px = 14;
  o.seeds.region = {10, 10, kWidth - 20, kHeight - 20};
  return o;
}

/// Where the point that is at X in frame 0 is.
inline Vec2 truth(int frame, const Vec2& X) {
  return motion(frame).forward(X);
}

}  // namespace rhytid::fitting::testing
