// How noisy the tracker is on footage in which nothing moves: the floor below which displacements mean
// nothing, and a check of the covariances against the scatter that is really there. Tests:
// tests/fitting/tracking/tracker_test.cpp (StillFootageGivesTheNoiseFloor)
#pragma once

#include "fitting/observations.h"

namespace rhytid::fitting {

struct NoiseFloor {
  int tracks = 0;           ///< with at least three ok observations after the first
  double scatter_px = 0;    ///< rms per axis of positions about each track's own mean
  double drift_px = 0;      ///< rms per axis of (mean position − first position)
  double predicted_px = 0;  ///< rms per axis that the covariances say
  /// rms of displacement from the first frame over its predicted deviation; 1 = covariances are right.
  double normalised = 0;
};

/// Statistics over frames first..last (inclusive) of tracks of things that do not move. Camera shake counts
/// as noise unless `remove_common_motion`, which subtracts the median displacement of each frame.
NoiseFloor measure_noise_floor(const TrackSet& tracks, int first_frame, int last_frame,
                               bool remove_common_motion);

}  // namespace rhytid::fitting
