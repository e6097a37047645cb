// Attaching tracks to skin: the pixel of a track in the first frame, cast onto the registered mesh, names the
// material point that the track follows. Tests: tests/fitting/raycast_test.cpp (Attachment)
#pragma once

#include <string>
#include <vector>

#include "fitting/cameras.h"
#include "fitting/observations.h"
#include "fitting/raycast.h"

namespace rhytid::fitting {

/// The material point of one track.
struct Attachment {
  int track = -1;     ///< index into TrackSet::tracks
  int triangle = -1;  ///< of the mesh cast against
  Vec3 barycentric;   ///< weights of the triangle's corners
  Vec3 point;         ///< mm, on the mesh as it was cast against
};

/// Why tracks have no material point.
struct AttachmentReport {
  int attached = 0;
  int not_seen = 0;     ///< not ok in the first frame
  int missed_mesh = 0;  ///< the ray passes the mesh, or the pixel has no ray
  int back_side = 0;    ///< the ray meets the mesh from behind: the mesh is wrongly placed or oriented
};

struct AttachmentResult {
  std::vector<Attachment> attachments;  ///< by increasing track index
  AttachmentReport report;
};

/// Casts the `frame` pixels of all tracks of `camera` (matched by name) onto the mesh as it is in that frame.
AttachmentResult attach_tracks(const TrackSet& tracks, const Camera& camera, const RayCaster& mesh,
                               int frame = 0);

}  // namespace rhytid::fitting
