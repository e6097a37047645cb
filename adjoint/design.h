// What planned experiments will tell, before any of them is made: their information adds, and the posterior
// with a prior follows, to first order.
//
//   Cov = (Σ_e R_eᵀR_e + diag(1/prior²))⁻¹    R_e: whitened Jacobian of experiment e, or its triangular root
//   D = ln det Cov: the volume of what remains possible      A = tr Cov: the sum of the variances
//
// in the coordinates of the Jacobian (log parameters). Smaller is better for both. D does not depend on how
// parameters are scaled or combined, A does. The covariance is formed from the triangular root of the stack,
// never from the sum of squares.
//
// Source   A. Atkinson, A. Donev, R. Tobias, Optimum Experimental Designs, 2007.
// Tests    tests/adjoint/design_test.cpp
#pragma once

#include <vector>

#include "sim/core/types.h"

namespace rhytid::adjoint {

/// What a plan makes as small as it can: D or A of the head of this file.
enum class DesignCriterion { d_optimality, a_optimality };
const char* name(DesignCriterion criterion);

struct Posterior {
  MatrixXd covariance;  ///< [n][n]
  double log_det = 0;   ///< D
  double trace = 0;     ///< A
  VectorXd deviations() const { return covariance.diagonal().cwiseSqrt(); }
  MatrixXd correlation() const;
  double value(DesignCriterion criterion) const {
    return criterion == DesignCriterion::d_optimality ? log_det : trace;
  }
};

/// Posterior of the experiments `chosen` (indices into `roots`, repetition counts twice) with standard
/// deviations of the prior [n]. Throws ContractError for sizes that do not fit, and for priors that are not
/// positive and finite: with them nothing is ever singular.
Posterior posterior(const std::vector<MatrixXd>& roots, const std::vector<int>& chosen,
                    const VectorXd& prior_deviations);

/// Expected information that a posterior has over the prior, bits: ½ log₂(det prior / det Cov).
double information_gain_bits(const Posterior& posterior, const VectorXd& prior_deviations);

struct DesignStep {
  int experiment = 0;  ///< chosen in this step
  double value = 0;    ///< of the criterion afterwards
};

/// Adds `steps` experiments one after the other, each the best beside those before it, to those `done`. Each
/// is taken once at most. The first of equals wins.
std::vector<DesignStep> greedy_design(const std::vector<MatrixXd>& roots, const VectorXd& prior_deviations,
                                      DesignCriterion criterion, const std::vector<int>& done, int steps);

struct DesignPair {
  int first = 0, second = 0;
  double value = 0;
};

/// All pairs of different experiments besides those `done`, best first.
std::vector<DesignPair> ranked_pairs(const std::vector<MatrixXd>& roots, const VectorXd& prior_deviations,
                                     DesignCriterion criterion, const std::vector<int>& done);

}  // namespace rhytid::adjoint
