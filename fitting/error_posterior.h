// What the residuals leave of errors that the model may have. Errors u of things that are held (consider.h,
// considered_quantities.h, path_deviations.h) and of finer steps (discretisation.h), one column each of
// C [residuals][errors], the change of the whitened residuals by a deviation, are taken for N(0, 1) before the residuals
// are looked at. The parameters fit J C u away; A = (1 − J (JᵀJ)⁺ Jᵀ) C stays to be seen in the residuals z. The answer
// is not moved, so given z its mean square error is, but for the noise,
//
//   E[(t̂ − t)(t̂ − t)ᵀ | z] = D E[u uᵀ | z] Dᵀ,   D = −(JᵀJ)⁺ Jᵀ C
//   E[u uᵀ | z] = V + û ûᵀ,   V = (AᵀA/w² + 1)⁻¹,   û = −V Aᵀz/w²
//
// of all errors together, since their posterior is correlated: what is told is often only that one or the other is off.
// An error without a part of its own in A counts in full, as in a consider covariance (Schmidt 1966); one that is told
// counts by what it is told to be; σ = 0 is exact, and more σ is more width where nothing else competes.
//
//   w² = w_0² + f² |Aû|²/γ,   w_0² = max(1, |z_⊥|²/(degrees of freedom − rank A)) (1 + ρ)/(1 − ρ)
//   γ = tr (AᵀA + w_0²)⁻¹ AᵀA
//
// w_0² is the noise as the fit has it for intervals, of the residuals z_⊥ that none of the errors explains, whatever is said of
// their size. Of what is believed of them, first order misses f² (kFirstOrder), in any of the γ directions that residuals
// tell: with the noise alone residuals are believed far beyond what linear columns can say, of finer steps too. û depends on
// w², which is the one solution of this. So a thing that is off by many times what is said of it is not told in full: alone, by
// three σ 2.2, by ten 4.1; but the further off, the wider.
//
// The residuals of coarse steps look like many things. So û of finer steps is not believed where that would narrow
// anything: the covariance is the least one that is nowhere below either of D E[u uᵀ | z] Dᵀ and the same with
// the errors of finer steps 0 ± 1 by themselves.
//
// Tests: tests/fitting/error_posterior_test.cpp, tests/fitting/considered_quantities_test.cpp
#pragma once

#include <vector>

#include "fitting/fit_problem.h"
#include "fitting/fit_result.h"

namespace rhytid::fitting {

/// Share of what a change of the model moves that its column, to first order and for itself, misses. Measured: between fits of
/// data/scenes/recovery_swipe with a layer and with one 10 % thicker residuals change by 0.3 otherwise than its column says.
inline constexpr double kFirstOrder = 0.3;

/// What the residuals leave of errors, in their deviations.
struct ErrorPosterior {
  VectorXd mean;                                                             ///< û [errors]
  MatrixXd covariance;                                                       ///< V [errors][errors]
  double variance = 1;                                                       ///< w²
  MatrixXd squares() const { return covariance + mean * mean.transpose(); }  ///< E[u uᵀ | z]
};

/// Of errors with these `columns` C; `basis` P with P Pᵀ = (JᵀJ)⁺. `degrees_of_freedom` and `autocorrelation` ρ are those of
/// the fit's residuals.
ErrorPosterior error_posterior(const FitProblem::Linearised& at, const MatrixXd& basis,
                               const MatrixXd& columns, int degrees_of_freedom, double autocorrelation);

/// Makes the axes of the shift those of this covariance of the parameters, and `shift` their deviations.
void set_covariance(const MatrixXd& covariance, SystematicShift& shift);

/// Weighs the shifts of a fit that have `columns` by its residuals: those of held things become what the residuals leave of
/// each, those of finer steps stay, and behind them comes kTogether with the covariance of all, whose axes
/// intervals have. Without anything held, or nothing that could be run of it, all stays. Takes the columns away.
void weigh_by_residuals(const FitProblem::Linearised& at, const MatrixXd& basis, int degrees_of_freedom,
                        double autocorrelation, std::vector<SystematicShift>& shifts);

}  // namespace rhytid::fitting
