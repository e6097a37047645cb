// Orthonormal D3-invariant polynomials on the equilateral triangle (circumradius 1, mean of 1 normalised to
// 1).
#pragma once

#include <vector>

#include "tools/rules/triangle_rule_search.h"

namespace rhytid::rules {

/// To the digits of Quad, x > 0.
Quad square_root(Quad x);

/// Values of φₖ and derivatives by the barycentric coordinates (a, b), c = 1 − a − b.
template <typename T>
struct InvariantValues {
  std::vector<T> value, d_da, d_db;  ///< [size of the basis]
};

/// φ₀ = 1, φ₁, ... spanning sᵃtᵇ, 2a + 3b ≤ degree, orthonormal in the mean over the triangle. They are made
/// by Gram-Schmidt in quadruple precision on an exact collapsed Gauss rule.
class InvariantBasis {
 public:
  explicit InvariantBasis(int degree);
  int size() const { return static_cast<int>(powers_.size()); }
  /// Total degree of φₖ; rises with k.
  int degree_of(int k) const { return 2 * powers_[k].s + 3 * powers_[k].t; }

  template <typename T>
  void evaluate(T a, T b, InvariantValues<T>& out) const;

  /// Number of invariants sᵃtᵇ of degree ≤ d (0 for negative d): the number of moment equations.
  static int count(int degree);

 private:
  struct Power {
    int s, t;
  };
  std::vector<Power> powers_;
  std::vector<std::vector<Quad>> coefficients_;  ///< φₖ = Σ_l coefficients_[k][l] s^{a_l} t^{b_l}
};

}  // namespace rhytid::rules
