// What the data determine, from the whitened Jacobian at the fit: J = U S Vᵀ (our own SVD; a rank-deficient
// problem gives infinite variances in named directions instead of an abort).
//
//   Var(gᵀt) = w² Σ_i (v_iᵀ g)² / s_i²,   w = widening
//
// or, where that is more, gᵀ A⁻¹ B A⁻¹ g with A = JᵀJ and B what the misfits of neighbouring tracks have in
// common (spatial_misfit.h).
//
// Columns of parameters without a transform are scaled by their range, so that one unit means "a factor e"
// for log parameters and "the whole range" for plain ones.
// Tests: tests/fitting/identifiability_test.cpp
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "fitting/parametrisation.h"

namespace rhytid::fitting {

/// Covariance of t at a fit.
class Identifiability {
 public:
  /// `jacobian` [residuals][parameters] of whitened residuals by t; `widening` multiplies all standard
  /// deviations. `misfit` [parameters][parameters] is B by t, scaled by the caller to the quantile it will
  /// use; empty: none.
  Identifiability(const MatrixXd& jacobian, const std::vector<FitVariable>& variables, double widening,
                  const MatrixXd& misfit = {});

  const VectorXd& singular_values() const { return singular_values_; }  ///< of scaled J, descending
  const MatrixXd& right_vectors() const { return right_vectors_; }      ///< columns, scaled parameters
  int rank() const { return rank_; }
  /// Standard deviation of gᵀt (g by t); infinite when g has a part in the null space.
  double sigma(const VectorXd& g) const;
  double sigma(int parameter) const;
  /// How many times wider the misfit makes a parameter's interval than the noise: 1 where the noise decides.
  double widened_by_misfit(int parameter) const;
  /// Of the scaled parameters; pairs with an undetermined member are NaN (1 on the diagonal).
  MatrixXd correlation() const;
  /// False when the standard deviation exceeds a factor e (log, logit) or a quarter of the range (plain).
  bool determined(int parameter) const;
  /// Sentences about directions and parameters that the data leave open; empty when all is determined.
  std::vector<std::string> cannot_tell() const;

 private:
  std::string direction_in_words(int i) const;
  /// Standard deviations of gᵀt from the noise and from the misfit; both infinite in the null space.
  std::pair<double, double> deviations(const VectorXd& g) const;

  std::vector<FitVariable> variables_;
  VectorXd scale_, singular_values_;
  MatrixXd right_vectors_;
  MatrixXd misfit_;  ///< of the scaled parameters along the right vectors; may be empty
  double widening_;
  int rank_ = 0;
};

/// 97.5 % quantile of Student's t, to 1e-7; fewer than one degree of freedom counts as one.
double student_quantile_975(int degrees_of_freedom);

/// Factor on all standard deviations for what the noise model missed: √max(1, χ²) for its size, and
/// √((1 + ρ)/(1 − ρ)) for its memory, since an AR(1) process of n values carries the information of
/// n (1 − ρ)/(1 + ρ) independent ones; ρ is cut to [0, 0.95].
double interval_widening(double reduced_chi_square, double autocorrelation);

/// Pooled lag-1 autocorrelation of series [n][2] with neighbours `frames` one apart; 0 when there are none.
double lag_one_autocorrelation(const std::vector<MatrixXd>& series,
                               const std::vector<std::vector<int>>& frames);

}  // namespace rhytid::fitting
