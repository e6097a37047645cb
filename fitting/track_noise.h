// How far the observations of one track are from a prediction, in units of their noise.
//
// The material point was attached where the track was seen in frame 0, so the error o of that first pixel
// shifts every later frame of the track alike. With r_f = observed_f − predicted_f, f = 1..n:
//   r_f = o + e_f,   o ~ N(0, C_0),   e_f ~ N(0, C_f)        (the deformation between frames acts on o as 1)
//   cost(r) = min_o ½ Σ_f ρ(|C_f^{−1/2} (r_f − o)|²) + ½ oᵀ C_0^{−1} o
// Without robust loss (ρ(s) = s) this is exactly ½ rᵀ Σ^{−1} r with the joint covariance
// Σ = diag(C_f) + (1 1ᵀ) ⊗ C_0; with it (Huber: ρ = s up to k², 2 k √s − k² beyond) one bad frame is
// discounted without leaking into the others through the common shift.
//
// Where the tracker renewed its template, frames from there on share a further shift. With s_0 = o and
// s_k = s_{k−1} + o_k the whole shift after the k-th renewal, o above is that of the frame's template and the
// last term becomes ½ s_0ᵀ C_0^{−1} s_0 + ½ Σ_k (s_k − s_{k−1})ᵀ R_k^{−1} (s_k − s_{k−1}).
//
// Source   marginalisation by variable projection (Golub and Pereyra 1973).   Units px.
// Tests    tests/fitting/track_noise_test.cpp
#pragma once

#include <vector>

#include "fitting/observations.h"
#include "sim/core/types.h"

namespace rhytid::fitting {

/// What observations count less than their covariances say: variances are divided by it.
struct TrackWeights {
  std::vector<double> frames =
      {};            ///< in (0, 1], of each observation used: of what its frame errs by itself; empty: 1
  double whole = 1;  ///< in (0, 1], of everything
};

/// The noise model of one track. Immutable.
class TrackNoise {
 public:
  struct Renewal {
    int from = 0;                ///< first of the later frames that has the further shift
    Eigen::Matrix2d covariance;  ///< R_k, px²
  };
  /// Covariances in px²: of the first frame and of each later one used. Throws ContractError when one is not
  /// positive definite. `huber` is k in standard deviations, 0 = plain least squares. `renewals` by frame.
  TrackNoise(const Eigen::Matrix2d& first, const std::vector<Eigen::Matrix2d>& later, double huber,
             const std::vector<Renewal>& renewals = {});
  /// Of the observations `used` of a track, ok and after its first ok one, in order; the deviations of the
  /// first and of each are raised to at least `floor` px. Renewals count from the first on, used or not.
  /// Weights come on top of the floor.
  TrackNoise(const Track& track, const std::vector<const Observation*>& used, double floor, double huber,
             const TrackWeights& weights = {});

  int num_observations() const { return static_cast<int>(roots_.size()); }
  int num_shifts() const { return static_cast<int>(shift_covariances_.size()); }  ///< one and every renewal
  /// Of the observation in the order given, which shift it has.
  int shift_of(int observation) const { return shift_of_[observation]; }
  /// Whitened values per track: two per observation and two per shift.
  int num_rows() const { return 2 * num_observations() + 2 * num_shifts(); }

  struct Evaluation {
    VectorXd whitened;  ///< [num_rows] z with ½|z|² = cost
    double cost = 0;
    VectorXd gradient;            ///< [2n] ∂cost/∂r, 1/px
    std::vector<double> weights;  ///< [n] of the robust loss, 1 = full
    VectorXd shift;               ///< [2 num_shifts] s, px
  };
  /// r is [2n] px.
  Evaluation evaluate(const VectorXd& r) const;

  /// Exact derivative of z along columns dr [2n][k], the shift's included. Its product with z is the
  /// gradient, its normal matrix without robust loss is drᵀ Σ^{−1} dr.
  MatrixXd whitened_jacobian(const VectorXd& r, const Evaluation& at, const MatrixXd& dr) const;

  /// dr and r whitened with the robust weights held fixed: what covariance estimates want. Each
  /// [num_rows][k].
  MatrixXd weighted_jacobian(const Evaluation& at, const MatrixXd& dr) const;
  VectorXd weighted_residual(const VectorXd& r, const Evaluation& at) const;

  /// Innovations [n][2]: every observation against what the earlier ones of the track predict, in standard
  /// deviations. White when the model and the covariances are right.
  MatrixXd innovations(const VectorXd& r, const Evaluation& at) const;

 private:
  void build(const std::vector<Eigen::Matrix2d>& later, const std::vector<Renewal>& renewals);
  VectorXd best_shift(const VectorXd& r, std::vector<double>& weights) const;
  /// Subtracts from each column its part along the columns of `basis` (num_rows × 2 num_shifts).
  static MatrixXd without(const MatrixXd& basis, MatrixXd columns);

  std::vector<Eigen::Matrix2d> roots_;              ///< C_f^{−1/2}: inverse lower Cholesky factors
  std::vector<int> shift_of_;                       ///< per observation
  std::vector<Eigen::Matrix2d> shift_covariances_;  ///< C_0, R_1, R_2, ...
  MatrixXd shift_root_;                             ///< [2 num_shifts][2 num_shifts]: whitened shifts by s
  double huber_;
};

/// The covariance with both standard deviations raised to at least min_sigma (px).
Eigen::Matrix2d with_floor(const Eigen::Matrix2d& covariance, double min_sigma);

}  // namespace rhytid::fitting
