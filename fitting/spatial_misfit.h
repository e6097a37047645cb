// What the model gets wrong alike at neighbouring points: the spread of the parameters that the tracks'
// scores themselves show, whatever the noise model says.
//
// At the optimum the scores s_i = J_iᵀ z_i of the tracks sum to zero (priors apart). Errors of the model
// (another mesh, another finger, a missing layer) make those of neighbours point the same way, over all
// frames. The sandwich
//
//   Cov = A⁻¹ B A⁻¹,   A = JᵀJ,   B = G/(G − 1) Σ_ij K(x_i − x_j) s_i s_jᵀ
//
// counts them as they come (Conley 1999, J. Econometrics 92; a track's frames fully, White 1980): K is the
// product of two triangles of half width L = 1/3 of the tracks' extent along either axis of the picture, so
// that B has no negative eigenvalue; G = 9 is the number of patches that are taken to err independently, and
// Student's t has 8 degrees. In a linear problem whose model errs over an eighth of the picture's side, 60 %
// of the intervals from the noise alone hold the truth and 86 % of these; without such errors 97 % do.
//
// Tests: tests/fitting/identifiability_test.cpp
#pragma once

#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

/// Patches along either axis of the picture whose errors are taken to be independent.
inline constexpr int kMisfitPatches = 3;
/// Degrees of freedom of an interval that rests on them.
inline constexpr int kMisfitDegrees = kMisfitPatches * kMisfitPatches - 1;

/// B above, by t. `scores` [parameters][tracks], `pixels` of the tracks in frame 0. Zero, that is no
/// statement, when all tracks stand on one row or column of the picture. Throws ContractError when the
/// numbers of tracks differ.
MatrixXd spatial_score_covariance(const MatrixXd& scores, const std::vector<Vec2>& pixels);

}  // namespace rhytid::fitting
