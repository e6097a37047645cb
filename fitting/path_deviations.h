// How well a measured path of a collider is known, and what that means for a fit.
//
// A path_file may say it for every knot, in columns behind its places (`rhytid finger` writes them):
//   own_xx, own_xy, own_xz, own_yy, own_yz, own_zz   mm²  covariance of what this knot errs by itself
//   shared_xx, ...                                   mm²  of what all knots err alike; the mean over the knots counts
//   sigma_x, sigma_y, sigma_z                        mm   in place of own_..: deviations that are independent
//
// A path is then off by   e_f = Σ_a s_a √λ_a v_a + Σ_b w_fb √λ_fb v_fb,   s_a, w_fb ~ N(0, 1) independent,
// with the principal axes v of the shared covariance and of those of the knots. Each s and w is a parameter that moves
// knots of the scene. By default all are considered (consider.h); with /fit/path_deviations `fit` the s are fitted with
// their prior, since all frames together tell more of a common offset than the finger's own picture did.
//
// Paths of several clips count as independent, from the same file too. How the finger turns, and where it is between
// knots, counts as known.
//
// Where a path states none, /fit/consider may say of "/colliders/NAME/path" how well it is known in each direction,
// all knots alike; where the case has no /fit/consider either, that is kPathSigma. An outline of a ball that is read to a
// pixel or two of 0.05 to 0.1 mm, and a pose of the camera that is off by as much, leave a quarter of a millimetre;
// so does the pad of a finger, which is no rigid ball. Guessed or stated, what counts is what the residuals leave of it, by
// s_a ~ N(0, 1) before (error_posterior.h): a finger that is off by more than was said widens by what the residuals say, and
// one that is where it should be by little. Directions in which the case fits knots are theirs.
//
// Tests: tests/fitting/path_deviations_test.cpp
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/fit.h"

namespace rhytid::fitting {

/// Deviation that where a path is is taken to have in each direction where neither it nor the case says so, mm.
inline constexpr double kPathSigma = 0.25;

struct PathDeviations {
  Mat3 shared = Mat3::Zero();  ///< mm²
  std::vector<Mat3> own;       ///< mm², by knot
};

/// What a path_file states; nothing when it has no such columns. Throws InputError "file:line" for a part of the columns
/// only, and for what is no covariance.
std::optional<PathDeviations> read_path_deviations(const std::string& file);

/// The input with `path_errors` of all colliders whose path is known to some deviation, those of its path_file up to the
/// last frame that is compared, those that are to be fitted among the parameters instead, and `path_notes` about them.
JointFitInput with_path_errors(const JointFitInput& input);

/// Notes on which of `path_errors` the shifts of the result hold, and so its intervals, and which they do not.
void add_path_notes(const JointFitInput& input, FitResult& result);

/// Makes the knots of the clips whose paths may be off parameters of their scenes: they are no longer those of a file.
void release_paths(JointFitInput& input);

}  // namespace rhytid::fitting
