#include "fitting/attachment.h"

#include <optional>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// The ray of a pixel, or nothing when the distortion has no inverse there.
std::optional<Ray> ray_of(const Camera& camera, const Vec2& pixel) {
  try {
    return camera.pixel_ray(pixel);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace

AttachmentResult attach_tracks(const TrackSet& tracks, const Camera& camera, const RayCaster& mesh,
                               int frame) {
  AttachmentResult result;
  AttachmentReport& report = result.report;
  for (int i = 0; i < static_cast<int>(tracks.tracks.size()); ++i) {
    const Track& track = tracks.tracks[i];
    if (track.camera != camera.name) continue;
    const Observation* o = track.at(frame);
    if (o == nullptr || o->status != TrackStatus::ok) {
      ++report.not_seen;
      continue;
    }
    const std::optional<Ray> ray = ray_of(camera, o->pixel);
    const std::optional<RayHit> hit = ray ? mesh.cast(*ray) : std::nullopt;
    if (!hit) {
      ++report.missed_mesh;
    } else if (!hit->front_facing) {
      ++report.back_side;
    } else {
      ++report.attached;
      result.attachments.push_back({i, hit->triangle, hit->barycentric, hit->point});
    }
  }
  return result;
}

}  // namespace rhytid::fitting
