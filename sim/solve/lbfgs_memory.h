// The last few steps and gradient changes, and their product with a vector. Internal to sim/solve.
#pragma once

#include <deque>

#include "sim/core/types.h"
#include "sim/solve/block_matrix.h"

namespace rhytid {

/// Limited-memory BFGS over a factorised initial Hessian H₀ (Nocedal and Wright, Algorithm 7.4).
class LbfgsMemory {
 public:
  explicit LbfgsMemory(int capacity) : capacity_(capacity) {}
  void clear() { pairs_.clear(); }
  /// Remembers step s and gradient change y; skipped when s·y < 1e-12 |s| |y|, which would spoil
  /// definiteness.
  void add(VectorXd s, VectorXd y);
  /// −H⁻¹ g with H₀⁻¹ applied by the factor.
  VectorXd descent_direction(const VectorXd& gradient, const CholeskyFactor& initial) const;

 private:
  struct Pair {
    VectorXd s, y;
    double inverse_sy;
  };
  int capacity_;
  std::deque<Pair> pairs_;  ///< oldest first
};

}  // namespace rhytid
