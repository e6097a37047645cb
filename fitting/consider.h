// What parameters that are held do to the answer when they are wrong: a consider covariance. With P Pᵀ = (JᵀJ)⁺ of
// the fit and J_h the whitened derivative by a held parameter h whose value is known to σ_h (transformed),
//
//   δ_h = −P Pᵀ Jᵀ J_h σ_h
//
// is by how much the answer moves, to first order, when h is off by σ_h. Residuals hardly show it: a wrong
// friction is fitted away by moduli. By what they show of it δ_h counts in the covariance (error_posterior.h).
// Numbers of the scene that no derivative is known of: considered_quantities.h.
//
// Source  Schmidt 1966; Tapley, Schutz and Born 2004, "consider covariance analysis".
// Tests   tests/fitting/consider_test.cpp
#pragma once

#include <vector>

#include "fitting/fit.h"

namespace rhytid::fitting {

/// Deviation that a friction coefficient is taken to have where the case says nothing, as a logarithm: a factor 1.35.
inline constexpr double kFrictionSigma = 0.3;

/// The parameters to consider: those of the case that are not fitted, or, where the case names none, the friction
/// coefficients of all colliders that are not, clip by clip where clips hold different values or only some fit it; σ_h
/// in prior_sigma; behind what paths of colliders are off by (`path_errors`). Those with σ_h = 0 are exact.
std::vector<FitParameter> considered_parameters(const JointFitInput& input);

/// Shifts in full, with their columns. One run of every clip with one more sweep, at `t`, where the problem was last
/// evaluated with the linearisation there. Nothing when there is nothing to consider or the observer stops it; runs are kept in,
/// and taken from, the log of evaluations. A parameter that the scene holds outside its usual bounds, and all when
/// the sweep fails, say so in `failure`.
std::vector<SystematicShift> considered_shifts(const JointFitInput& input, JointProblem& problem,
                                               const VectorXd& t, const FitProblem::Linearised& linearised,
                                               const MatrixXd& basis, const FitObserver& observer);

}  // namespace rhytid::fitting
