// What the model gets wrong alike at neighbouring points: the spread of the parameters that the tracks'
// scores themselves show, whatever the noise model says.
//
// At the optimum the scores s_i = J_iᵀ z_i of the tracks sum to zero (priors apart). Errors of the model
// (another mesh, another finger, a missing layer) make those of neighbours point the same way, over all
// frames. The sandwich (Conley 1999, J. Econometrics 92) counts them as they come:
//
//   Cov = A⁻¹ B A⁻¹,   A = JᵀJ,   B = Σ_ij K(|x_i − x_j|) s_i s_jᵀ,   K(d) = exp(−d²/2L²)
//
// B is too small and rests on few independent patches: what is smooth over the picture was fitted away, and
// what is farther apart than L is not counted. By how much follows from a reference Σ of how residuals are
// alike (Bell and McCaffrey 2002, Survey Methodology 28; Imbens and Kolesár 2016, Rev. Econ. Stat. 98):
//
//   Σ_ij = σ² δ_ij + Σ_g τ_g² exp(−|x_i − x_j|²/2 l_g²)  between tracks, in each frame and axis anew,
//
// σ², τ_g² >= 0 from the products of residuals by distance, whose expectation under M = 1 − J A⁻¹ Jᵀ is
// known. With B_0 = JᵀΣJ and E = E[B] under Σ, B is replaced by C B Cᵀ, C E Cᵀ = B_0, which is right on
// average if Σ is, and a variance gᵀA⁻¹CBCᵀA⁻¹g has as many degrees of freedom as its mean and variance under
// Σ tell (Satterthwaite 1946). L is where tr(E⁻¹B_0) is least: the least depends on Σ there.
//
// Errors of different clips are independent: K and Σ are zero between them, so B is a sum over clips, while A
// and M are those of all clips together.
//
// Only the shape of Σ matters, not its size. The last two steps are what makes intervals hold on patches that
// are narrow or small against the length over which errors are alike; fitting/README.md has the figures.
// Tests: tests/fitting/spatial_misfit_test.cpp
#pragma once

#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

/// One track, whitened, at the optimum.
struct WhitenedTrack {
  Vec3 place;             ///< mm at rest; or px in frame 0 (third 0) where one camera saw all
  std::vector<int> rows;  ///< which quantities its rows are: the same number in another track is the same
                          ///< frame and axis; not negative
  MatrixXd jacobian;      ///< [rows][parameters]
  VectorXd residuals;     ///< [rows]
  int clip = 0;           ///< errors of different clips are independent
};

/// The corrected sandwich in coordinates in which A is the identity.
class SpatialMisfit {
 public:
  /// `basis` [parameters][rank] with basisᵀ A basis = 1: columns of parameters that change all residuals
  /// together by one. No statement, a covariance of zero, where all tracks are at one place or as few as the
  /// parameters. Beyond 1500 tracks every second, third, ... is used, which can only widen.
  SpatialMisfit(const std::vector<WhitenedTrack>& tracks, const MatrixXd& basis);

  /// C B Cᵀ [rank][rank]: the covariance of the coordinates.
  const MatrixXd& covariance() const { return covariance_; }
  /// Degrees of freedom of gᵀ covariance() g, g [rank]; at least one.
  double degrees(const VectorXd& g) const;
  double kernel_width() const { return kernel_width_; }  ///< L, in the unit of places; 0 = no statement

 private:
  /// Σ_k weights_ik J_k in the rows in which track i is seen, laid out as jacobian_.
  MatrixXd smoothed_jacobian(const MatrixXd& weights) const;
  /// Σ_ij weights_ij J_iᵀ J_j over the rows in which both are seen [rank][rank].
  MatrixXd weighted_normal(const MatrixXd& weights) const;
  /// `largest` of the distances within clips.
  void fit_reference(const MatrixXd& distances, double largest);
  void choose_kernel(const MatrixXd& distances, double largest);
  /// Σ over pairs (i, j) of `kernel` times E[s_i s_jᵀ].
  MatrixXd expected_sum(const MatrixXd& kernel) const;

  Eigen::Index rank_ = 0;
  MatrixXd jacobian_;         ///< [tracks][rows · rank], zero where a track is not seen
  MatrixXd residuals_;        ///< [tracks][rows]
  MatrixXd seen_;             ///< [tracks][rows], one or zero
  MatrixXd reference_;        ///< Σ [tracks][tracks]
  MatrixXd reference_sum_;    ///< B_0 [rank][rank]
  MatrixXd own_, neighbour_;  ///< per track A_i and Σ_k Σ_ki J_kᵀJ_i, [tracks][rank · rank]
  MatrixXd to_own_;           ///< from coordinates in which A of the tracks used is 1 to those asked for
  MatrixXd kernel_, correction_, covariance_;
  double kernel_width_ = 0;
};

}  // namespace rhytid::fitting
