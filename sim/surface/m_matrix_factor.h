// Factorisation of a symmetric M-matrix given as a weighted graph, without a single subtraction.
//
//   A = diag(slack) + Σ_edges w (e_i − e_j)(e_i − e_j)ᵀ,   slack ≥ 0, w > 0
//
// Gaussian elimination keeps this form: every pivot is the sum of its row's remaining weights and slack, and
// eliminating a row only adds to the others (Grassmann, Taksar, Heyman 1985; O'Cinneide 1996 for the error
// bound). So each entry of the factor, and each entry of the solution for a right-hand side ≥ 0, has a small
// relative error of its own, however small it is beside the others and however nearly singular A is: diffused
// values keep their digits far away from their source, and long diffusion times are no special case.
#pragma once

#include <vector>

#include "sim/core/types.h"

namespace rhytid {

struct WeightedEdge {
  int i, j;
  double weight;
};

class MMatrixFactor {
 public:
  /// slack [n] ≥ 0; edges with 0 ≤ i, j < n, i ≠ j, each pair at most once, weight > 0. Throws ContractError
  /// when a connected component with edges has no slack at all (A is singular).
  MMatrixFactor(const VectorXd& slack, const std::vector<WeightedEdge>& edges);

  /// A⁻¹ rhs, shape [n][num_rhs]. Rows of nodes with neither slack nor edges are zero.
  MatrixXd solve(const MatrixXd& rhs) const;

  /// Off-diagonal entries of the factor.
  std::size_t num_entries() const { return rows_.size(); }

 private:
  // In elimination order. Column j below the pivot is −values_[k] at rows_[k], k in [starts_[j],
  // starts_[j+1]).
  std::vector<int> order_;  // order_[position] = node
  VectorXd pivots_;
  std::vector<std::size_t> starts_;
  std::vector<int> rows_;
  std::vector<double> values_;
};

}  // namespace rhytid
