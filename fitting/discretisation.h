// What the discretisation of the fitted scene does to the answer: at the best point each kind of step is made
// finer by itself (elements through the thickness, in the plane, time steps) and the same tracks are
// predicted again. With W the whitening and J the Jacobian of the fit, fixed robust weights, to first order
//
//   δ_r = −(JᵀJ)⁺ Jᵀ W (predicted − predicted_r)
//
// is by how much the answer would move. No residual of the fit can show it: what an error of the
// discretisation shares with a parameter is fitted away. Each δ_r enters the covariance as δ_r δ_rᵀ
// (identifiability.h).
//
// Tests: tests/fitting/discretisation_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/fit.h"

namespace rhytid::fitting {

/// A scene with one kind of step finer than in another.
struct FinerScene {
  std::string name;    ///< thickness | plane | steps
  std::string change;  ///< in words: "order 4 in the plane instead of 3"
  Scene scene;
};

/// The variants of `scene` that its error is judged by. Where the order in the plane is the highest already,
/// the variant has one less: what that changes bounds the error from above.
std::vector<FinerScene> finer_scenes(const Scene& scene);

/// One forward run per clip and variant at `t`, where the problem was last evaluated, with the linearisation
/// there; `basis` P has P Pᵀ = (JᵀJ)⁺. A variant that cannot be run says so in `failure`; nothing when
/// the observer stops it. Runs are kept in, and taken from, the log of evaluations like the fit's own.
std::vector<SystematicShift> discretisation_shifts(const JointFitInput& input, JointProblem& problem,
                                                   const VectorXd& t,
                                                   const FitProblem::Linearised& linearised,
                                                   const MatrixXd& basis, const FitObserver& observer);

}  // namespace rhytid::fitting
