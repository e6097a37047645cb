// How far tracks are from the truth: each track's first pixel names a material point of the true surface, and
// that point's own path through the picture is what the track should have been.
#pragma once

#include "fitting/cameras.h"
#include "fitting/case.h"
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
  /// Root of the mean of eᵀ Σ⁻¹ e / 2, Σ = first + own covariance: 1 when the covariances are right, above
  /// when they promise too much.
  double normalised = 0;
  /// Of these errors under the noise model that a fit uses, its floor and robust loss included: what the
  /// reduced chi-square of a fit would be if the model of the skin made no error.
  double reduced_chi_square = 0;
};

/// Compares all ok observations of the camera's tracks; frames beyond the surface's are left out. `noise`:
/// floor and robust loss of the fit.
TrackingError tracking_error(const fitting::TrackSet& tracks, const MovingSurface& truth,
                             const fitting::Camera& camera, const fitting::FitCase& noise);

}  // namespace rhytid::tools
