// Where the head is in each frame, from tracked points that stand still on it: then the skin's own motion is
// what is left. The scene's coordinates are those of the head, so that a head that moves before a camera that
// stands still is a camera that moves about a head that stands still.
//
// The pixel of a still point in frame 0 says where on the head it is; in frame f the pose minimises
// Σ ρ(rᵀ (C_f + C_0)⁻¹ r) over the still points, r = observed − project_f(X), ρ Huber's loss. Its covariance
// max(1, χ²) H⁻¹ goes into that of every skin point of the frame, by ∂pixel/∂pose.
//
// Units  px, mm, rad.   Tests  tests/fitting/head_motion_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/observations.h"
#include "fitting/pose.h"
#include "sim/scene/scene.h"

namespace rhytid::fitting {

/// A box of the scene's coordinates in which tracked points stand still on the head: nose, forehead, teeth.
struct StillRegion {
  std::string name;
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();  ///< corners, mm
  bool contains(const Vec3& x) const {
    return (x.array() >= low.array()).all() && (x.array() <= high.array()).all();
  }
};

/// A track that follows a point of the head.
struct StillTrack {
  int track;   ///< index into TrackSet::tracks
  Vec3 point;  ///< mm
};

/// The head before one camera.
struct HeadMotion {
  std::vector<Camera> cameras;  ///< by frame, as if the head stood still; frame 0 as given
  /// By frame, of the pose about `middle` (pose.h); zero in frame 0. Not known: no pose could be found there,
  /// since too few still points are seen.
  std::vector<Matrix6d> covariance;
  std::vector<bool> known;
  Vec3 middle = Vec3::Zero();  ///< mm: centroid of the still points

  int num_tracks = 0;
  double largest_turn = 0;   ///< rad, against frame 0
  double largest_shift = 0;  ///< mm, of `middle`
  double rms_px = 0;         ///< of what is left, all frames
  double reduced_chi_square = 0;
  /// Of what the pose in a frame adds to the covariance of a pixel there; [2][2] px².
  Eigen::Matrix2d pixel_covariance(int frame, const Vec3& point) const;
};

/// Fewest still points for a pose: half of them more than it needs.
inline constexpr int kFewestStillPoints = 6;

/// The tracks of `camera` (by name) whose first pixel lies on the surface of the scene, whole, in one of the regions. Throws
/// InputError for fewer than kFewestStillPoints and for a surface that cannot be read.
std::vector<StillTrack> find_still_tracks(const TrackSet& tracks, const Camera& camera,
                                          const SurfaceScene& surface,
                                          const std::vector<StillRegion>& regions);

/// Poses of frames 0..frames. `floor` px is the least deviation of a displacement per axis, `huber` in
/// deviations (0: none).
HeadMotion estimate_head_motion(const TrackSet& tracks, const std::vector<StillTrack>& still,
                                const Camera& camera, int frames, double floor, double huber);

}  // namespace rhytid::fitting
