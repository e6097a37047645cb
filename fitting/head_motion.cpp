#include "fitting/head_motion.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "fitting/attachment.h"
#include "fitting/track_noise.h"
#include "sim/core/error.h"
#include "sim/scene/scene_surface.h"

namespace rhytid::fitting {
namespace {

constexpr int kRounds = 30;        ///< of reweighting
constexpr double kSettled = 1e-6;  ///< change of all weights that ends it

/// Still points that are seen in a frame, with their full weight.
std::vector<SightedPoint> seen_in(const TrackSet& tracks, const std::vector<StillTrack>& still, int frame,
                                  double floor) {
  std::vector<SightedPoint> points;
  for (const StillTrack& s : still) {
    const Track& track = tracks.tracks[s.track];
    const std::vector<Eigen::Matrix2d> shared = track.shared_covariances();
    for (std::size_t i = 0; i < track.observations.size(); ++i) {
      const Observation& o = track.observations[i];
      if (o.frame != frame || o.status != TrackStatus::ok) continue;
      points.push_back({o.pixel, s.point, with_floor(o.covariance + shared[i], floor).inverse()});
    }
  }
  return points;
}

/// The pose of one frame with robust weights.
struct FramePose {
  Camera camera;
  Matrix6d covariance;
  double chi_square = 0, squares = 0;  ///< with the weights; of residuals, px²
  int degrees = 0, points = 0;
};

FramePose frame_pose(const std::vector<SightedPoint>& points, const Camera& start, double huber) {
  FramePose found{start, Matrix6d::Zero()};
  std::vector<SightedPoint> weighted = points;
  std::vector<double> weights(points.size(), 1);
  for (int round = 0; round < kRounds; ++round) {
    found.camera = refine_pose(weighted, found.camera);
    double change = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vec2 r = points[i].pixel - found.camera.project(points[i].point);
      const double size = std::sqrt(r.dot(points[i].information * r));
      const double weight = huber > 0 && size > huber ? huber / size : 1;
      change = std::max(change, std::fabs(weight - weights[i]));
      weights[i] = weight;
      weighted[i].information = weight * points[i].information;
    }
    if (change < kSettled) break;
  }
  const PoseNormal normal = pose_normal(weighted, found.camera);
  found.chi_square = normal.chi_square;
  found.points = static_cast<int>(points.size());
  found.degrees = 2 * found.points - 6;
  for (const SightedPoint& p : points)
    found.squares += (p.pixel - found.camera.project(p.point)).squaredNorm();
  found.covariance =
      std::max(1.0, normal.chi_square / found.degrees) * normal.hessian.ldlt().solve(Matrix6d::Identity());
  return found;
}

}  // namespace

Eigen::Matrix2d HeadMotion::pixel_covariance(int frame, const Vec3& point) const {
  const auto jacobian = pose_jacobian(cameras[frame], point, middle);
  return jacobian * covariance[frame] * jacobian.transpose();
}

std::vector<StillTrack> find_still_tracks(const TrackSet& tracks, const Camera& camera,
                                          const SurfaceScene& surface,
                                          const std::vector<StillRegion>& regions) {
  SurfaceScene whole = surface;
  whole.crop_centre.reset();
  whole.crop_low.reset();
  whole.crop_high.reset();
  whole.crop_vertices.clear();
  whole.crop_vertices_file.clear();
  whole.subdivide = 0;
  const TriangleSurface head = scene_surface(whole);
  const AttachmentResult attached = attach_tracks(tracks, camera, RayCaster(head.vertices, head.faces));
  std::vector<StillTrack> still;
  for (const Attachment& a : attached.attachments)
    if (std::any_of(regions.begin(), regions.end(),
                    [&](const StillRegion& r) { return r.contains(a.point); }))
      still.push_back({a.track, a.point});
  if (static_cast<int>(still.size()) < kFewestStillPoints)
    throw InputError(
        "fit: /fit/still",
        std::to_string(still.size()) + " tracks of camera '" + camera.name + "' in its boxes",
        "at least " + std::to_string(kFewestStillPoints) + ", better 20 or more, spread over the head");
  return still;
}

HeadMotion estimate_head_motion(const TrackSet& tracks, const std::vector<StillTrack>& still,
                                const Camera& camera, int frames, double floor, double huber) {
  require(!still.empty() && frames >= 0, "estimate_head_motion: no still track");
  HeadMotion motion;
  motion.num_tracks = static_cast<int>(still.size());
  for (const StillTrack& s : still) motion.middle += s.point / static_cast<double>(still.size());
  motion.cameras.assign(static_cast<std::size_t>(frames) + 1, camera);
  motion.covariance.assign(static_cast<std::size_t>(frames) + 1, Matrix6d::Zero());
  motion.known.assign(static_cast<std::size_t>(frames) + 1, false);
  motion.known[0] = true;
  double chi_square = 0, squares = 0;
  int degrees = 0, count = 0;
  Camera before = camera;
  for (int f = 1; f <= frames; ++f) {
    const std::vector<SightedPoint> points = seen_in(tracks, still, f, floor);
    motion.cameras[f] = before;
    if (static_cast<int>(points.size()) < kFewestStillPoints) continue;
    const FramePose found = frame_pose(points, before, huber);
    if (!std::isfinite(found.chi_square) || !found.covariance.allFinite()) continue;
    motion.cameras[f] = before = found.camera;
    motion.known[f] = true;
    motion.covariance[f] = found.covariance;
    chi_square += found.chi_square, squares += found.squares;
    degrees += found.degrees, count += found.points;
    const Mat3 turn = found.camera.rotation * camera.rotation.transpose();
    motion.largest_turn = std::max(motion.largest_turn, Eigen::AngleAxisd(turn).angle());
    const Vec3 shift = (found.camera.rotation * motion.middle + found.camera.translation) -
                       (camera.rotation * motion.middle + camera.translation);
    motion.largest_shift = std::max(motion.largest_shift, shift.norm());
  }
  motion.reduced_chi_square = degrees > 0 ? chi_square / degrees : 0;
  motion.rms_px = std::sqrt(squares / std::max(1, count));
  return motion;
}

}  // namespace rhytid::fitting
