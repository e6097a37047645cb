// Where a sphere is, by its outline in a picture: the path of a finger from footage.
//
// A line of sight o + s d touches the sphere (centre c, radius r) where it passes the centre at the distance r:
//   w = c − o,   w_⊥ = w − (w·d) d,   e = κ (|w_⊥| − r),   ∂e/∂c = κ w_⊥ᵀ / |w_⊥|
// e > 0 outside. κ is the scale of the picture there, across the outline, so that e is in px.
//
// From a start the outline is drawn by the whole camera, distortion included; along its normal in the picture the
// gradient of the smoothed picture, averaged over the stretch between neighbouring samples, says where an edge is.
//   1. coarse: of all shifts and changes of size within the window, the one that has most edge under the outline,
//      Σ g²/(g² + m²), m the upper quartile of g: one strong spot of skin counts no more than one sample
//   2. fine: the strongest edge within a few px of each sample, to a part of a px by a parabola; c by Gauss-Newton
//      on Σ ρ(e), ρ Tukey's; drawn and searched again until it stands still
// What hides a part of the outline (a hand, skin into which it sinks) leaves gradually: within 12° of a run of samples
// that did not fit, samples are left out too.
//
//   Cov(c) = 1/5 Σ_b (c_b − c)(c_b − c)ᵀ,   c_b the fit without b, over all blocks b of 5 neighbours
// A jackknife, by blocks because neighbours err alike. Each c_b has weights of its own, v w: w Tukey's, whose cut comes from
// the residuals, v = min(1, (g/usual g)²), since a faint edge is less sure. A linearised variance at fixed weights is half
// of that where few edges carry the fit: they pull it towards themselves, and the cut gives way to them. This holds what
// samples scatter, not what all err alike: a finger that is no sphere, a wrong radius or camera. Size tells depth: a radius wrong by one per cent moves the centre by one per cent of its distance.
//
// Source  Harris and Stennett 1990 (RAPID); Armstrong and Zisserman 1995 (robust); Künsch 1989 (blocks).   Units  px, mm.
// Tests   tests/fitting/finger_outline_test.cpp
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "fitting/cameras.h"

namespace rhytid::fitting {

/// A place on the outline of a sphere.
struct OutlinePoint {
  Vec3 point = Vec3::Zero();   ///< where the line of sight touches, mm
  Vec2 pixel = Vec2::Zero();   ///< its image, px
  Vec2 normal = Vec2::Zero();  ///< outward across the outline, of length 1
  double px_per_mm = 0;        ///< κ: how far the image goes along `normal` when the sphere grows by 1 mm
};

/// `count` places around the outline; empty when the sphere is not wholly in front of the camera.
std::vector<OutlinePoint> sphere_outline(const Vec3& centre, double radius, const Camera& camera, int count);

/// e and its derivative by the centre (px, px/mm). The ray must not pass through the centre.
struct OutlineResidual {
  double value;
  Vec3 by_centre;
};
OutlineResidual outline_residual(const Ray& ray, const Vec3& centre, double radius, double px_per_mm);

struct OutlineOptions {
  int samples = 120;          ///< around the outline; fewer where they would be nearer than 4 px
  double window = 12;         ///< px to either side of the start that are searched
  double smoothing = 1;       ///< px, standard deviation of the Gaussian that the picture is smoothed with
  double least_share = 0.33;  ///< of the samples that must fit, or the finger is lost
};

/// An edge that was found, and what became of it.
struct OutlineEdge {
  Vec2 pixel = Vec2::Zero();
  double residual = 0;  ///< px from the outline of the estimate
  double weight = 0;    ///< Tukey's, 0 = left out
};

struct OutlineEstimate {
  std::string lost;                ///< why there is no estimate; empty: there is one
  Vec3 centre = Vec3::Zero();      ///< mm
  Mat3 covariance = Mat3::Zero();  ///< mm²
  double across_sigma = 0;         ///< mm, the larger one across the line of sight to the centre
  double depth_sigma = 0;          ///< mm, along it: the worst known
  int samples = 0, used = 0;       ///< around the outline; with an edge that fits
  double rms = 0;                  ///< px, of the edges that fit
  std::vector<OutlineEdge> edges;
};

/// The sphere's centre in a picture (CV_8UC3 or CV_8U, of the camera's size), searched from `start`. Throws
/// ContractError for another picture; what the picture does not show is no error but `lost`.
OutlineEstimate find_sphere(const cv::Mat& picture, const Camera& camera, const Vec3& start, double radius,
                            const OutlineOptions& options = {});

}  // namespace rhytid::fitting
