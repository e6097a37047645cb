// By how much an answer would move if the model were another, by one more forward run of it: with W the whitening and
// J the Jacobian of the fit, fixed robust weights, to first order
//
//   δ = −(JᵀJ)⁺ Jᵀ W Δ,   Δ = change of observed − predicted
//
// For errors of the discretisation (discretisation.h) and for numbers of the scene that no derivative is known of
// (considered_quantities.h).
//
// Tests: tests/fitting/discretisation_test.cpp, tests/fitting/considered_quantities_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/fit.h"

namespace rhytid::fitting {

/// The fit with another model.
struct OtherFit {
  std::string name, change;  ///< as those of SystematicShift
  std::string note;          ///< what is said when its run begins
  JointFitInput input;       ///< parameters as those of the fit
  std::string failure = {};  ///< why there is no such model; empty where there is
  ResidualAxis axis = {};  ///< what the change is one of, for its signature; estimate and sigma are filled in
};

/// One forward run per clip of each at `t`, where `problem` was last evaluated, with the linearisation there; `basis` P
/// has P Pᵀ = (JᵀJ)⁺. Tracks that only one of both could attach count as not moved. What cannot be run says so in
/// `failure`; nothing when the observer stops it. Runs are kept in, and taken from, the log of evaluations that each
/// input names.
std::vector<SystematicShift> difference_shifts(const std::vector<OtherFit>& others, JointProblem& problem,
                                               const VectorXd& t, const FitProblem::Linearised& linearised,
                                               const MatrixXd& basis, const FitObserver& observer);

}  // namespace rhytid::fitting
