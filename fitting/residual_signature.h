// What the residuals of a fit say about things that it held. The change of the whitened residuals with each of a
// group of changes is a column of C; its part that the fitted parameters cannot make is A = (1 − J (JᵀJ)⁺ Jᵀ) C.
// Of the residuals z at the answer that part is explained best by
//
//   s = −(AᵀA)⁻¹ Aᵀ z   with covariance (AᵀA)⁻¹ per unit of the residuals' variance,
//
// and |z|² falls by zᵀA (AᵀA)⁻¹ Aᵀz. To first order s is what a fit of those things together with the parameters
// would find: by how much of its change each is off. It says what the residuals look like, not what is wrong:
// other errors of the model may look alike. What it leaves of errors whose size is known before:
// error_posterior.h.
//
// Tests: tests/fitting/residual_signature_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/fit_problem.h"
#include "fitting/fit_result.h"

namespace rhytid::fitting {

/// Fills `signature` and `explained` of the shift from `columns` C [residuals][axes] and what each is the change by.
/// Left empty where the fitted parameters make all that the columns do.
void add_signature(const FitProblem::Linearised& at, const MatrixXd& basis, const MatrixXd& columns,
                   const std::vector<ResidualAxis>& axes, SystematicShift& shift);

/// A: the part of the columns that the fitted parameters cannot make.
MatrixXd own_part(const FitProblem::Linearised& at, const MatrixXd& basis, const MatrixXd& columns);

/// Sentences on a reduced chi-square of the result that is well above what noise makes: which of the changes that were looked
/// at (`result.systematic`) the residuals look like, the one that explains most first, with those of its axes that are
/// three deviations or more from 0; or that they look like none. `degrees_of_freedom` are those of the chi-square,
/// `autocorrelation` that of the residuals within tracks.
std::vector<std::string> misfit_sentences(const FitResult& result, int degrees_of_freedom,
                                          double autocorrelation);

}  // namespace rhytid::fitting
