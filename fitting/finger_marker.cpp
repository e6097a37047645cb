#include "fitting/finger_marker.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "fitting/marker_search.h"
#include "fitting/pose.h"
#include "fitting/track_noise.h"
#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid::fitting {
namespace {

constexpr double kLeastExtent = 0.05;  // of the second axis of points over the first: thinner is a line
constexpr double kDoubtful = 2;        // deviations that residuals are off by

std::vector<MarkerPoint> tracked_points(const TrackSet& tracks, const std::vector<Landmark>& marker,
                                        double floor) {
  std::vector<MarkerPoint> points;
  for (std::size_t i = 0; i < marker.size(); ++i)
    for (const Track& track : tracks.tracks) {
      const Observation* first = track.at(0);
      if (first == nullptr || first->status != TrackStatus::ok || first->pixel != marker[i].pixel) continue;
      if (std::none_of(track.observations.begin(), track.observations.end(),
                       [](const Observation& o) { return o.frame > 0 && o.status == TrackStatus::ok; }))
        break;
      const Eigen::Matrix2d picked = marker[i].sigma * marker[i].sigma * Eigen::Matrix2d::Identity(),
                            of_template = with_floor(first->covariance, floor / std::numbers::sqrt2);
      MarkerPoint& point = points.emplace_back();
      point.marker = i;
      point.track = &track;
      point.place = marker[i].point;
      point.common = picked + of_template;
      const Eigen::Matrix2d k = of_template * point.common.inverse();
      point.gain_in_first -= k;
      const Eigen::Matrix2d own = of_template - k * of_template;
      // Rounding of the difference where one of the two is far smaller
      point.own_in_first = with_floor(0.5 * (own + own.transpose()), 1e-4);
      break;
    }
  return points;
}

std::vector<MarkerSight> sights_in(const std::vector<MarkerPoint>& points, int frame, double floor) {
  std::vector<MarkerSight> sights;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const MarkerPoint& point = points[i];
    const Observation* o = point.track->at(frame);
    if (o == nullptr || o->status != TrackStatus::ok) continue;
    MarkerSight& s = sights.emplace_back();
    s.point = static_cast<int>(i);
    s.pixel = o->pixel;
    if (frame == 0) {
      s.gain = point.gain_in_first;
      s.information = point.own_in_first.inverse();
      continue;
    }
    const std::vector<Eigen::Matrix2d> shared = point.track->shared_covariances();
    const auto at = static_cast<std::size_t>(o - point.track->observations.data());
    const Eigen::Matrix2d renewed = shared[at] - point.track->at(0)->covariance;
    s.information = (with_floor(o->covariance, floor / std::numbers::sqrt2) + renewed).inverse();
  }
  return sights;
}

/// Rotation and perhaps depth known, the rest of the translation from the points by linear least squares: for
/// undistorted (x, y), t_x − x t_z = x q_z − q_x with q = R p. Nothing where the points do not determine it or are
/// behind the camera.
std::optional<Camera> translated(const Camera& start, const std::vector<Landmark>& points, bool holds_depth) {
  const auto n = static_cast<Eigen::Index>(points.size());
  MatrixXd by = MatrixXd::Zero(2 * n, holds_depth ? 2 : 3);
  VectorXd value(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Landmark& l = points[static_cast<std::size_t>(i)];
    const Vec2 x = start.undistorted(l.pixel);
    const Vec3 q = start.rotation * l.point;
    const double depth = q.z() + (holds_depth ? start.translation.z() : 0);
    by.block<2, 2>(2 * i, 0).setIdentity();
    if (!holds_depth) by.block<2, 1>(2 * i, 2) = -x;
    value.segment<2>(2 * i) = x * depth - q.head<2>();
  }
  const Eigen::JacobiSVD<MatrixXd> svd(by, Eigen::ComputeThinU | Eigen::ComputeThinV);
  if (!holds_depth && svd.singularValues()[2] < 1e-6 * svd.singularValues()[0]) return std::nullopt;
  const VectorXd t = svd.solve(value);
  Camera found = start;
  found.translation.head(t.size()) = t;
  for (const Landmark& l : points)
    if (!found.project(l.point).allFinite()) return std::nullopt;
  return found;
}

/// The start in frame 0.
Camera first_pose(const std::vector<Landmark>& points, const Camera& camera, const BodyPose& of_scene,
                  bool turns, bool holds_depth, const std::string& where, MarkerMotion& motion) {
  const Camera as_scene = seen_from_body(camera, of_scene);
  const std::optional<Camera> shifted = translated(as_scene, points, holds_depth);
  if (!turns) {
    if (shifted) return *shifted;
    throw InputError(
        where,
        holds_depth ? "marker points of which some are behind the camera, at the scene's depth"
                    : "marker points that no place in front of the camera explains",
        "pixels and x_mm, y_mm, z_mm that belong together, along the axes of the collider; points apart "
        "from each other across the line of sight");
  }
  const PoseEstimate best = estimate_pose(points, camera, where);
  if (best.other_tilt == 0) return best.camera;
  motion.other_tilt = best.other_tilt;
  std::vector<SightedPoint> sighted;
  for (const Landmark& l : points)
    sighted.push_back({l.pixel, l.point, Eigen::Matrix2d::Identity() / (l.sigma * l.sigma)});
  const Camera near = refine_pose(sighted, shifted ? *shifted : as_scene);
  const double chi_square = pose_normal(sighted, best.camera).chi_square;
  const bool is_as_good =
      pose_normal(sighted, near).chi_square <= chi_square + 9 * std::max(1.0, best.reduced_chi_square);
  return is_as_good ? near : best.camera;
}

bool on_a_line(const std::vector<Landmark>& points) {
  MatrixXd places(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i) places.row(static_cast<Eigen::Index>(i)) = points[i].point;
  places.rowwise() -= places.colwise().mean().eval();
  const VectorXd extents = Eigen::JacobiSVD<MatrixXd>(places).singularValues();
  return !(extents[1] > kLeastExtent * extents[0]);
}

void add_sigmas(const Camera& camera, MarkerFrame& frame) {
  const Vec3 sight = (frame.pose.centre - camera.centre()).normalized(), side = sight.unitOrthogonal();
  Eigen::Matrix<double, 3, 2> across;
  across << side, sight.cross(side);
  const Eigen::Matrix2d c = across.transpose() * frame.covariance * across;
  frame.across_sigma =
      std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(c).eigenvalues()[1]));
  frame.depth_sigma = std::sqrt(std::max(0.0, sight.dot(frame.covariance * sight)));
}

void add_doubts(MarkerMotion& motion) {
  if (motion.shift_scale > kDoubtful)
    motion.doubts.push_back(
        "the marker's points are off by " + short_text(motion.shift_scale, 2) +
        " times their deviation: their places on the finger, their pixels or the camera are "
        "wrong, or the stated deviation is too small");
  if (motion.own_scale > kDoubtful)
    motion.doubts.push_back("what is left of the tracks is " + short_text(motion.own_scale, 2) +
                            " times what their deviations say: the points do not move like a body that " +
                            (motion.turns ? "keeps its shape" : "turns as the scene's path says"));
}

}  // namespace

std::vector<Landmark> read_marker(const std::string& path, double sigma) {
  return read_landmarks(path, sigma, [](long) -> Vec3 {
    throw InputError("x_mm, y_mm, z_mm instead: from the collider's centre, along its own axes");
  });
}

void require_in_picture(const std::vector<Landmark>& marker, int width, int height, int half) {
  for (const Landmark& l : marker) {
    const std::string pixel =
        "'" + l.name + "' at " + short_text(l.pixel.x(), 6) + ", " + short_text(l.pixel.y(), 6);
    if (!(l.pixel.x() >= half && l.pixel.y() >= half && l.pixel.x() <= width - 1 - half &&
          l.pixel.y() <= height - 1 - half))
      throw InputError(l.place, pixel,
                       "a pixel from " + std::to_string(half) + ", " + std::to_string(half) + " to " +
                           std::to_string(width - 1 - half) + ", " + std::to_string(height - 1 - half) +
                           ", so that its window lies in the picture");
    for (const Landmark* other = marker.data(); other != &l; ++other)
      if (other->pixel == l.pixel) throw InputError(l.place, pixel, "a pixel of its own for every point");
  }
}

MarkerMotion follow_marker(const TrackSet& tracks, const std::vector<Landmark>& marker, const Camera& camera,
                           const std::vector<BodyPose>& of_scene, const MarkerOptions& options,
                           const std::string& where) {
  require(!of_scene.empty(), "follow_marker: no frame");
  MarkerMotion motion;
  motion.frames.resize(of_scene.size());
  motion.is_tracked.assign(marker.size(), false);
  motion.shifts.assign(marker.size(), Vec2::Zero());
  const std::vector<MarkerPoint> points = tracked_points(tracks, marker, options.floor);
  std::vector<Landmark> used;
  for (const MarkerPoint& p : points) {
    motion.is_tracked[p.marker] = true;
    used.push_back(marker[p.marker]);
  }
  const std::string got = std::to_string(points.size()) + " of " +
                          counted(static_cast<long>(marker.size()), "marker point") + " that can be tracked";
  if (points.size() < (options.depth_of_scene ? 1 : 2))
    throw InputError(where, got,
                     points.empty() ? "points with texture about them"
                                    : "2 or more apart across the view, whose distance tells the depth, or "
                                      "--depth-of-scene to take it from the scene's path");
  motion.turns = points.size() >= 4 && !options.hold_rotation && !options.depth_of_scene && !on_a_line(used);
  PoseBasis basis = PoseBasis::Identity(6, 6);
  if (!motion.turns) basis = basis.rightCols(3).eval();
  if (options.depth_of_scene) basis = basis.leftCols(2).eval();
  const int needed = motion.turns ? 4 : options.depth_of_scene ? 1 : 2;

  MarkerSearch search(points, basis, options.huber);
  std::vector<FramedMarker> frames;
  std::optional<BodyPose> before;
  int last_found = 0;
  for (int f = 0; f < static_cast<int>(of_scene.size()); ++f) {
    MarkerFrame& out = motion.frames[static_cast<std::size_t>(f)];
    FramedMarker frame{f, camera, sights_in(points, f, options.floor)};
    out.seen = static_cast<int>(frame.sights.size());
    if (out.seen < needed) {
      out.lost =
          std::to_string(out.seen) + " of " + counted(static_cast<long>(points.size()), "marker point") +
          (out.seen == 1 ? " is" : " are") + " seen, at least " + std::to_string(needed) + " are needed";
      continue;
    }
    BodyPose start = of_scene[static_cast<std::size_t>(f)];
    if (!before) {
      frame.pose = first_pose(used, camera, start, motion.turns, options.depth_of_scene, where, motion);
    } else {
      // Where it moved to since the frame before as the scene says, its error kept
      const BodyPose& then = of_scene[static_cast<std::size_t>(last_found)];
      if (motion.turns) start.rotation = before->rotation;
      const Vec3 as_scene = seen_from_body(camera, start).translation;
      start.centre += before->centre - then.centre;
      frame.pose = seen_from_body(camera, start);
      if (options.depth_of_scene) frame.pose.translation.z() = as_scene.z();
    }
    if (!search.place(frame)) {
      out.lost = "the marker points that are seen do not determine where it is";
      if (f == 0)
        throw InputError(where, "marker points that do not determine the centre",
                         "points apart from each other across the line of sight");
      continue;
    }
    before = body_of(camera, frame.pose);
    last_found = f;
    frames.push_back(std::move(frame));
  }
  search.settle(frames);
  search.conclude(frames, camera, motion);
  for (MarkerFrame& frame : motion.frames)
    if (frame.lost.empty()) add_sigmas(camera, frame);
  add_doubts(motion);
  return motion;
}

}  // namespace rhytid::fitting
