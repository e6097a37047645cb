// From tracks to material points: which point of the skin does each track follow?
//
// The pixel of a track's first observation (frame 0, skin at rest) is cast onto the subdivided outer surface,
// which names a face; Newton's method then finds the natural coordinates (u, v) whose exact high-order
// surface point is seen at that pixel, crossing into neighbouring faces where need be:
//   project(Σ_a P_a(u, v) X_a) = pixel
// Tests: tests/fitting/registration_test.cpp
#pragma once

#include <vector>

#include "adjoint/outputs.h"
#include "fitting/cameras.h"
#include "fitting/observations.h"
#include "sim/mesh/skin_mesh.h"

namespace rhytid::fitting {

/// A track with the material point that it follows.
struct RegisteredTrack {
  int track = -1;                ///< index into TrackSet::tracks
  adjoint::MaterialPoint point;  ///< on the outer surface
};

/// What became of the tracks of a camera.
struct RegistrationReport {
  int registered = 0;
  int not_seen = 0;     ///< not ok in frame 0: such tracks cannot be attached at rest
  int missed_mesh = 0;  ///< the ray passes the skin, or the pixel has no ray
  int back_side = 0;    ///< the ray meets the skin from behind
  int near_rim = 0;     ///< closer to the rim than the margin
  int not_refined = 0;  ///< no face holds a point that is seen at the pixel (a silhouette)
  int left_out() const { return not_seen + missed_mesh + back_side + near_rim + not_refined; }
};

struct Registration {
  std::vector<RegisteredTrack> tracks;  ///< by increasing track index
  RegistrationReport report;
};

/// Attaches every track of `camera` (matched by name) to the rest skin. Tracks whose point lies within
/// `rim_margin` mm (straight distance) of the rim of the outer surface are left out.
Registration register_tracks(const TrackSet& tracks, const Camera& camera, const SkinMesh& mesh,
                             double rim_margin);

}  // namespace rhytid::fitting
