#include "tools/render/tracking_error.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "fitting/track_noise.h"
#include "tools/render/skin_renderer.h"
#include "tools/render/surface_view.h"

namespace rhytid::tools {

using fitting::Observation;
using fitting::TrackStatus;

TrackingError tracking_error(const fitting::TrackSet& tracks, const MovingSurface& truth,
                             const fitting::Camera& camera, const fitting::FitCase& noise) {
  const SubdividedSurface tessellation(truth.mesh, SurfaceSide::outer, subdivision_for(truth, camera, 3));
  std::map<int, SurfaceView> views;  // of the frames in which tracks begin
  const auto view_of = [&](int frame) -> const SurfaceView& {
    return views.try_emplace(frame, truth, tessellation, camera, frame).first->second;
  };
  TrackingError out;
  std::vector<double> distances;
  std::map<int, std::pair<double, int>> by_frame;  // sum of squares, count
  double chi = 0, whitened = 0;
  for (const fitting::Track& track : tracks.tracks) {
    if (track.camera != camera.name) continue;
    const auto is_ok = [&truth](const Observation& o) {
      return o.status == TrackStatus::ok && o.frame < truth.frames();
    };
    const auto first = std::find_if(track.observations.begin(), track.observations.end(), is_ok);
    if (first == track.observations.end()) continue;
    const auto point = view_of(first->frame).pick(first->pixel);
    if (!point) {
      ++out.off_skin;
      continue;
    }
    ++out.tracks;
    const std::vector<Eigen::Matrix2d> shared = track.shared_covariances();
    std::vector<const Observation*> used;
    std::vector<double> errors;
    for (auto o = first + 1; o != track.observations.end(); ++o) {
      if (!is_ok(*o)) continue;
      const Vec2 error = o->pixel - camera.project(truth.position(*point, o->frame));
      if (!error.allFinite()) continue;
      distances.push_back(error.norm());
      const Eigen::Matrix2d covariance = shared[o - track.observations.begin()] + o->covariance;
      chi += error.dot(covariance.inverse() * error) / 2;
      used.push_back(&*o);
      errors.insert(errors.end(), {error.x(), error.y()});
      auto& [sum, count] = by_frame[o->frame];
      sum += error.squaredNorm(), ++count;
    }
    if (errors.empty()) continue;
    const fitting::TrackNoise model(track, used, noise.min_sigma / std::sqrt(2.), noise.robust_scale);
    const VectorXd r = Eigen::Map<const VectorXd>(errors.data(), static_cast<Eigen::Index>(errors.size()));
    whitened += model.weighted_residual(r, model.evaluate(r)).squaredNorm();
  }
  if (distances.empty()) return out;
  std::sort(distances.begin(), distances.end());
  const size_t n = distances.size();
  double squares = 0;
  for (const double d : distances) {
    if (d > 1 && out.gross++ == 0) out.inlier_rms_px = squares;
    squares += d * d;
  }
  if (out.gross == 0) out.inlier_rms_px = squares;
  const double inliers = std::max(1.0, static_cast<double>(n) - out.gross);
  out.inlier_rms_px = std::sqrt(out.inlier_rms_px / inliers);
  out.observations = static_cast<int>(n);
  out.rms_px = std::sqrt(squares / static_cast<double>(n));
  out.median_px = distances[n / 2], out.p95_px = distances[n * 95 / 100], out.largest_px = distances.back();
  out.normalised = std::sqrt(chi / static_cast<double>(n));
  out.reduced_chi_square = whitened / (2 * static_cast<double>(n));
  const auto& [sum, count] = by_frame.rbegin()->second;
  out.last_frame_rms_px = std::sqrt(sum / count);
  return out;
}

}  // namespace rhytid::tools
