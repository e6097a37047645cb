// How far tracks are from the truth: each track's first pixel names a material point of the true surface, and
// that point's own path through the picture is what the track should have been.
#pragma once

#include "fitting/cameras.h"
#include "fitting/observations.h"
#include "tools/render/moving_surface.h"

namespace rhytid::tools {

struct TrackingError {
  int tracks = 0;        ///< compared
  int off_skin = 0;      ///< tracks whose first pixel is not on the skin
  int observations = 0;  ///< compared, the first of each track not counted
  double rms_px = 0, median_px = 0, p95_px = 0, largest_px = 0;  ///< of the distances
  int gross = 0;                 ///< observations more than 1 px off: the tracker followed something else
  double inlier_rms_px = 0;      ///< of the others
  double last_frame_rms_px = 0;  ///< of the observations in the last frame that has any
  /// Root of the mean of eᵀ Σ⁻¹ e / 2: 1 when the covariances are right, above when they promise too much.
  double normalised = 0;
};

/// Compares all ok observations of the camera's tracks; frames beyond the surface's are left out.
TrackingError tracking_error(const fitting::TrackSet& tracks, const MovingSurface& truth,
                             const fitting::Camera& camera);

}  // namespace rhytid::tools
