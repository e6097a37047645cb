// What a minimiser needs to know of a problem: energy, gradient, Hessian, how far a step may go.
#pragma once

#include "sim/core/types.h"
#include "sim/solve/block_matrix.h"

namespace rhytid {

/// Which Hessian is wanted: the true one (certificate, adjoint), or one made positive semi-definite point by
/// point.
enum class Curvature { raw, projected };

/// A twice differentiable energy of the block unknowns q [num_unknowns]. Fixed unknowns have zero gradient
/// and identity rows in the Hessian, so a minimiser needs no notion of constraints.
class Objective {
 public:
  virtual ~Objective() = default;
  virtual const BlockPattern& pattern() const = 0;
  /// Energy [mJ] at q; +inf where it is not defined (J ≤ 0, overflow). Writes the gradient [N] when asked and
  /// finite.
  virtual double energy(const VectorXd& q, VectorXd* gradient) = 0;
  /// 2-norm over all components of the sum of absolute element forces, at the last evaluation with a gradient
  /// [N]: the scale against which the residual is judged.
  virtual double force_scale() const = 0;
  /// Hessian at q into `out` (set to zero first).
  virtual void hessian(const VectorXd& q, Curvature curvature, BlockMatrix& out) = 0;
  /// Largest s with q + s d still feasible (J > 0 at every point), +inf if unlimited.
  virtual double largest_feasible_step(const VectorXd& q, const VectorXd& d) = 0;
};

}  // namespace rhytid
