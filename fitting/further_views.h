// What another camera, or the same clip once more, would add to an answer: predicted before it is filmed.
//
// With H = JᵀJ of the fit and ∂X/∂t of the tracked material points, a camera K that saw the same points, each
// with its track's noise, would add H_K = Σ J_Kᵀ J_K, J_K the whitened −∂project_K/∂X ∂X/∂t. Deviations from noise
// then are √diag (H + H_K)⁻¹ instead of √diag H⁻¹. What the discretisation and the model do to an answer, no
// view makes smaller.
//
// Source  Fedorov's information of a planned observation (as in adjoint/design.h).
// Tests   tests/fitting/further_views_test.cpp
#pragma once

#include <vector>

#include "fitting/fit_result.h"
#include "fitting/joint_problem.h"

namespace rhytid::fitting {

/// The same clip filmed once more, and cameras at the same distance turned by 45° about the middle of the tracked
/// points, to four sides of the first camera of each clip; left out are those from which the skin is seen
/// at less than 20°. Cameras are not predicted where frame 0 moves with the parameters (a skin that settles) and for
/// fewer than three points. At `t`, where the problem was last evaluated with the linearisation `at`.
std::vector<FurtherView> further_views(JointProblem& problem, const VectorXd& t,
                                       const FitProblem::Linearised& at);

}  // namespace rhytid::fitting
