// Where a finger is, by tracked points of it (a marker: dots on the nail): the path of a finger from footage.
//
// Point i lies at p_i in the finger's own axes, from the collider's centre, and is seen at
//   x_fi = project(c_f + R_f p_i) + s_i + e_fi,   e_fi ~ N(0, C_fi),   s_i ~ N(0, σ_i² 1 + C_0i)
// with the track's covariances (observations.h): C_fi is what frame f errs by itself, C_0i the noise of the template,
// common to all frames. σ_i is the deviation of the pixel that was named and of p_i as it is seen, common to all frames
// too. In frame 0 the track is by definition at the pixel named, so that the template's noise is not in it: with
// K = C_0 (σ² 1 + C_0)⁻¹ what is left of s there is (1 − K) s + N(0, C_0 − K C_0). Where a template was renewed, what is
// shared from there on counts as the frame's own: on the safe side.
//
// All poses and shifts s are found together, so that a point that comes or goes does not move the path by what its pixel
// was named wrong: Gauss-Newton on
//   Σ_fi ρ(|C_fi^{−1/2} r_fi|²) + Σ_i s_iᵀ (σ_i² 1 + C_0i)⁻¹ s_i,   ρ Huber's,
// poses eliminated frame by frame. With H_f that of a pose and H_fs its product with the shifts,
//   Cov(pose_f) = H_f⁻¹ + H_f⁻¹ H_fs Cov(s) H_sf H_f⁻¹
// the first term is what the frame errs by itself, the second what all err alike. Either is widened where its residuals
// are larger than stated.
//
// What is found depends on what is seen: four points or more, not on a line, tell also how the finger turns (R_f); two
// or three, or when asked, the centre alone, R_f that of the scene's path, depth by the distance of points in the
// picture; one, when asked, the centre at the depth of the scene's path.
//
// Units  px, mm, rad.   Tests  tests/fitting/finger_marker_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/landmarks.h"
#include "fitting/observations.h"
#include "sim/scene/collider_motion.h"

namespace rhytid::fitting {

struct MarkerOptions {
  bool hold_rotation =
      false;  ///< how the finger turns is that of the scene's path, however many points there are
  bool depth_of_scene = false;  ///< so is the centre's depth along the optical axis; holds the rotation too
  double floor = 0.05;          ///< px, least deviation of a displacement since frame 0
  double huber = 3;             ///< in deviations; 0: none
};

/// The finger in one frame.
struct MarkerFrame {
  std::string lost;                ///< why there is no estimate; empty: there is one
  BodyPose pose;                   ///< of the collider, world
  Mat3 covariance = Mat3::Zero();  ///< of the centre, mm²
  Mat3 own = Mat3::Zero();         ///< of it, what this frame errs by itself
  double across_sigma = 0;         ///< mm, the larger one across the line of sight to the centre
  double depth_sigma = 0;          ///< mm, along it; not what the scene's depth is off by
  double turn_sigma = 0;           ///< rad, about the worst known axis; 0: held
  int seen = 0;                    ///< points
  double rms = 0;                  ///< px per point, of what is left
};

struct MarkerMotion {
  bool turns = false;               ///< whether rotations were found
  std::vector<MarkerFrame> frames;  ///< as asked for
  std::vector<bool> is_tracked;     ///< by point: seen in frame 0 and in a later one
  std::vector<Vec2>
      shifts;              ///< s_i, px: from where p_i is seen to where the track runs; zero without a track
  double own_scale = 1;    ///< of residuals, in stated deviations: frames by themselves
  double shift_scale = 0;  ///< of shifts, in stated deviations; 0 where nothing is left to judge them by
  double other_tilt = 0;   ///< rad to another way of turning that the points nearly allow in frame 0; 0: none
  std::vector<std::string> doubts;  ///< sentences
};

/// The points of a marker, as landmarks are read, in the form with x_mm, y_mm, z_mm: from the collider's centre, along
/// its own axes. `sigma` px is for those without sigma_px. Throws InputError naming file and line.
std::vector<Landmark> read_marker(const std::string& path, double sigma);

/// Throws InputError naming the line of a point whose window of ± `half` px does not lie in the picture, or that has the
/// pixel of another.
void require_in_picture(const std::vector<Landmark>& marker, int width, int height, int half);

/// `tracks` begin at the pixels of `marker`, in frame 0; points without such a track are left out. `of_scene` is the
/// scene's path, by frame. Throws InputError beginning with `where` when the points that are tracked do not determine
/// the centre in frame 0, naming what is missing; later frames are lost instead.
MarkerMotion follow_marker(const TrackSet& tracks, const std::vector<Landmark>& marker, const Camera& camera,
                           const std::vector<BodyPose>& of_scene, const MarkerOptions& options,
                           const std::string& where);

}  // namespace rhytid::fitting
