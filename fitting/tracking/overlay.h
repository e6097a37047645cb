// Tracks drawn over the footage, coloured by their uncertainty.
// Tests: tests/fitting/tracking/frame_source_test.cpp (Overlay)
#pragma once

#include <string>

#include "fitting/observations.h"
#include "fitting/tracking/frame_source.h"

namespace rhytid::fitting {

struct OverlayOptions {
  double full_scale_px =
      0;                  ///< standard deviation drawn red; 0 = the 95 % quantile of the tracks, rounded up
  int trail_frames = 12;  ///< length of the tail behind each point
  int scale = 1;          ///< enlarges small footage
};

struct OverlayReport {
  std::string path;   ///< the file written: as asked, or with .avi when no H.264 encoder works
  std::string codec;  ///< "avc1" or "MJPG"
  int frames = 0;
};

/// Reads `source` from its current position and writes a video beside which the tracks of `camera` are drawn:
/// dots from blue (sure) to red (unsure), crosses where a track was lost or covered (in the frame where it
/// happened). H.264 in mp4 when an encoder is there, else Motion JPEG in avi. The file appears only when
/// complete. Throws InputError when no video can be written.
OverlayReport write_overlay(FrameSource& source, const TrackSet& tracks, const std::string& camera,
                            const std::string& path, const OverlayOptions& options = {});

}  // namespace rhytid::fitting
