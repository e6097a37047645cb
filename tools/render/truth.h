// Exact ground truth of rendered footage.
#pragma once

#include <nlohmann/json.hpp>

#include "fitting/observations.h"
#include "sim/scene/scene_model.h"
#include "tools/render/finger.h"
#include "tools/render/surface_view.h"

namespace rhytid::tools {

/// Standard deviation written into exact tracks, px: small, but a covariance has to be positive definite.
inline constexpr double truth_sigma_px = 1e-3;

/// Follows a grid of material points, one every `spacing_px` of frame 0, through the frames of a surface.
/// Points are seen through the camera, exactly; hidden ones (by the finger or by folds) are occluded.
class TruthTracker {
 public:
  /// All references must outlive the tracker.
  TruthTracker(const MovingSurface& surface, const SubdividedSurface& tessellation,
               const fitting::Camera& camera, int spacing_px);
  /// Adds the observations of a frame; frames in order from 0. `fingers` cover skin.
  void add_frame(int frame, const std::vector<Finger>& fingers);
  const fitting::TrackSet& tracks() const { return tracks_; }
  const std::vector<MaterialPoint>& points() const { return points_; }

 private:
  const MovingSurface& surface_;
  const SubdividedSurface& tessellation_;
  const fitting::Camera& camera_;
  int spacing_px_;
  std::vector<MaterialPoint> points_;
  fitting::TrackSet tracks_;
};

/// truth.json: values of all fit-able parameters that the fit's scene and the truth share, and how the truth
/// was discretised. `stride`: steps of the truth's frame rate per frame of footage.
nlohmann::json truth_record(const Scene& fit, const SceneModel& truth, int stride, int frames);

}  // namespace rhytid::tools
