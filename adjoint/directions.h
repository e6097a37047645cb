// Which directions of the parameters a Jacobian feels, and which it does not: its singular value
// decomposition by our own code, so that a rank-deficient problem has named null vectors instead of an abort.
//
//   J = U S Vᵀ,   rank: singular values above 1e-8 of the largest (the accuracy of a tangent sweep)
//   P = V S⁻¹:    in the coordinates y, t = P y, a unit of y changes the outputs by one
//
// Shapes   J [outputs][parameters].    Tests   tests/adjoint/directions_test.cpp
#pragma once

#include <string>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::adjoint {

struct Directions {
  VectorXd singular_values;  ///< descending [n]
  MatrixXd right_vectors;    ///< columns [n][n], the largest component of each positive
  int rank = 0;

  /// P [n][rank] with Pᵀ JᵀJ P = 1.
  MatrixXd basis() const;
  /// Whether g (a derivative by the parameters) has a part along null vectors: gᵀt is then not determined.
  bool is_open(const VectorXd& g) const;
};

/// Throws ContractError unless J is finite and has as many rows as columns at least.
Directions directions_of(const MatrixXd& jacobian);

/// Turns the null vectors so that the first is `direction`, if it is one of theirs (to 1e-6 of its length);
/// false when it is not.
bool lead_null_space(Directions& directions, const VectorXd& direction);

/// The components of a direction that its words name, largest first: not those below 0.3 of the largest, and
/// eight at most.
std::vector<int> named_components(const VectorXd& direction);

/// A direction as the words of a sentence: "a, b trade off against c: raising the former while lowering the
/// latter", "a, b go together: raising all of them", "a is not determined: changing it". Components below
/// 0.3 of the largest are left out, and all beyond eight are counted only.
std::string direction_in_words(const VectorXd& direction, const std::vector<std::string>& names);

/// Upper triangular R [n][n] with RᵀR = AᵀA + BᵀB: adds the rows of B to those that made A. An empty A adds
/// nothing.
MatrixXd stacked_root(const MatrixXd& A, const MatrixXd& B);

}  // namespace rhytid::adjoint
