// What the data determine, from the whitened Jacobian at the fit: J = U S Vᵀ (our own SVD; a rank-deficient
// problem gives infinite variances in named directions instead of an abort).
//
//   Var(gᵀt) = |Pᵀg|² in units of the noise,   P = V S⁻¹:  in the coordinates y, t = P y, each residual-sized
//   change is one, and Cov(y) = w² 1 from the noise alone, w = widening
//
// What neighbouring tracks err alike (spatial_misfit.h) is another estimate of Cov(y), with eigenvalues λ_i
// and eigenvectors u_i. The covariance is the least one that is nowhere below either:
//
//   Cov(t) = P U max(w², Λ) Uᵀ Pᵀ
//
// A systematic shift δ that is known only in size (discretisation.h) adds δ δᵀ, as if it were one standard
// deviation of a normal law.
//
// One matrix gives deviations, correlations and intervals. An interval has the degrees of freedom of the two
// parts of its variance together (Welch and Satterthwaite); shifts add 1.96 |gᵀδ| each, in squares.
//
// Columns of parameters without a transform are scaled by their range, so that one unit means "a factor e"
// for log parameters and "the whole range" for plain ones.
// Tests: tests/fitting/identifiability_test.cpp
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "fitting/parametrisation.h"
#include "fitting/spatial_misfit.h"

namespace rhytid::fitting {

/// Covariance of t at a fit.
class Identifiability {
 public:
  /// `jacobian` [residuals][parameters] of whitened residuals by t; `widening` multiplies the standard
  /// deviations of the noise, which has so many `degrees_of_freedom`. `tracks` are the parts of the Jacobian
  /// and the residuals that belong to tracks; none: the noise alone.
  Identifiability(const MatrixXd& jacobian, const std::vector<FitVariable>& variables, double widening,
                  int degrees_of_freedom, const std::vector<WhitenedTrack>& tracks = {});

  /// Adds a shift [parameters] of t that the data cannot show.
  void add_systematic(const std::vector<double>& shift);

  const VectorXd& singular_values() const { return singular_values_; }  ///< of scaled J, descending
  const MatrixXd& right_vectors() const { return right_vectors_; }      ///< columns, scaled parameters
  int rank() const { return rank_; }
  /// P [parameters][rank] with Pᵀ JᵀJ P = 1.
  const MatrixXd& basis() const { return basis_; }
  /// Standard deviation of gᵀt (g by t); infinite when g has a part in the null space.
  double sigma(const VectorXd& g) const;
  double sigma(int parameter) const;
  /// The part of it that comes from noise and misfit.
  double noise_sigma(const VectorXd& g) const;
  /// Degrees of freedom of noise_sigma(g)²; one when g has a part in the null space.
  double degrees(const VectorXd& g) const;
  /// Half of the 95 % interval of gᵀt: Student's quantile times noise_sigma, and 1.96 times each shift;
  /// infinite as sigma is.
  double half_width(const VectorXd& g) const;
  double half_width(int parameter) const;
  /// How many times larger the misfit makes a parameter's noise_sigma than the noise; 1 = not at all.
  double widened_by_misfit(int parameter) const;
  /// Of t, from the same covariance as sigma; pairs with an undetermined member are NaN (1 on the diagonal).
  MatrixXd correlation() const;
  /// False when the standard deviation exceeds a factor e (log, logit) or a quarter of the range (plain).
  bool determined(int parameter) const;
  /// Sentences about directions and parameters that the data leave open; empty when all is determined.
  std::vector<std::string> cannot_tell() const;

 private:
  std::string direction_in_words(int i) const;
  /// Standard deviation along right vector i < rank() of the scaled parameters.
  double deviation_along(int i) const;
  double systematic(const VectorXd& g) const;  ///< root of the sum of squares of the shifts of gᵀt
  bool is_open(const VectorXd& g) const;       ///< has a part in the null space

  std::vector<FitVariable> variables_;
  VectorXd scale_, singular_values_;
  MatrixXd right_vectors_, basis_;
  SpatialMisfit misfit_;
  MatrixXd directions_;  ///< U [rank][rank]
  VectorXd variances_;   ///< max(w², λ)
  std::vector<VectorXd> systematic_;
  double widening_;
  int degrees_of_freedom_, rank_ = 0;
};

/// 97.5 % quantile of Student's t, to 1e-7; fewer than one degree of freedom counts as one.
double student_quantile_975(double degrees_of_freedom);

/// Factor on all standard deviations for what the noise model missed: √max(1, χ²) for its size, and
/// √((1 + ρ)/(1 − ρ)) for its memory, since an AR(1) process of n values carries the information of
/// n (1 − ρ)/(1 + ρ) independent ones; ρ is cut to [0, 0.95].
double interval_widening(double reduced_chi_square, double autocorrelation);

/// Pooled lag-1 autocorrelation of series [n][2] with neighbours `frames` one apart; 0 when there are none.
double lag_one_autocorrelation(const std::vector<MatrixXd>& series,
                               const std::vector<std::vector<int>>& frames);

}  // namespace rhytid::fitting
