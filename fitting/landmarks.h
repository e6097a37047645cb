// Where a camera stands to the mesh, from a few landmarks: points of the mesh picked in the picture.
//
// File: CSV with a header; columns by name, in any order:
//   name,x_px,y_px,vertex                 vertex of the mesh file, counted from 0 as in crop lists
//   name,x_px,y_px,x_mm,y_mm,z_mm         or a point in the coordinates of the scene
// and sigma_px where landmarks are not all alike. Lines that begin with # are passed over.
//
// The pose R, t (X_c = R X + t) minimises Σ |observed − project(X)|²/σ² over landmarks: OpenCV's SQPnP, then
// Gauss-Newton with the exact derivatives of the camera. Nearly flat sets of landmarks have a second minimum,
// tilted the other way; both are looked at. The covariance is that of the linearised problem, about the
// landmarks' centroid m in the camera's frame,
//   X_c = exp(ω) (R X + t − m) + m + τ,     Cov(ω, τ) = max(1, χ²) (Jᵀ Σ⁻¹ J)⁻¹.
//
// Source  Terzakis and Lourakis 2020 (SQPnP, in OpenCV).   Units  px, mm, rad.
// Tests   tests/fitting/landmarks_test.cpp
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "fitting/cameras.h"

namespace rhytid::fitting {

/// A point of the mesh seen in the picture.
struct Landmark {
  std::string name;
  Vec2 pixel = Vec2::Zero();  ///< px, centres of pixels at integers
  Vec3 point = Vec3::Zero();  ///< mm, coordinates of the scene
  double sigma = 1;           ///< px, per axis
  std::string place = {};     ///< "file:line", for messages; empty when it comes from no file
};

/// The pose and how well it is known.
struct PoseEstimate {
  Camera camera;                             ///< as given, with rotation and translation
  std::vector<Vec2> residuals;               ///< observed − projected, px
  std::vector<double> left_out;              ///< px from where the others put it; empty below 5 landmarks
  double rms = 0;                            ///< px per landmark: √(Σ|residual|²/n)
  double reduced_chi_square = 0;             ///< with 2n − 6 degrees of freedom; 0 for none
  Eigen::Matrix<double, 6, 6> covariance;    ///< of (ω, τ): rad, mm
  double tilt_sigma = 0, roll_sigma = 0;     ///< rad: across and about the line of sight
  double across_sigma = 0, depth_sigma = 0;  ///< mm: of the centroid across and along the line of sight
  double other_tilt = 0;                     ///< rad to a pose that explains them nearly as well; 0: none
  std::vector<std::string> doubts;           ///< sentences
};

/// Reads the file described above; `vertex` gives the place of a vertex, or throws InputError whose text says
/// what is expected. `sigma` is for landmarks that have none of their own. Throws InputError
/// "file:line: ..." for what cannot be read, for a name given twice or not in UTF-8, and for no landmark.
std::vector<Landmark> read_landmarks(const std::string& path, double sigma,
                                     const std::function<Vec3(long)>& vertex);

/// Throws InputError naming `where` for fewer than 4 landmarks, for landmarks on a line, and when no pose in front of the
/// camera explains them at all.
PoseEstimate estimate_pose(const std::vector<Landmark>& landmarks, const Camera& camera,
                           const std::string& where);

}  // namespace rhytid::fitting
