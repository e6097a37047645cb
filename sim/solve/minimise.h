// The minimisers: Newton with projection on demand (default) and L-BFGS over a frozen factor (the publication's,
// and ours), with a certificate that the result is a minimum.
//
// Source   DESIGN section 3; paper.tex "Non-Linear Solver".
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/solve/objective.h"

namespace rhytid {

enum class Minimiser {
  newton,            ///< raw Hessian; per-point projected one for two iterations when it is not positive definite
  newton_projected,  ///< always projected (baseline)
  lbfgs,             ///< L-BFGS over a projected factor (publication: memory 10, refresh 50)
};

struct MinimiserOptions {
  Minimiser method = Minimiser::newton;
  /// Converged when |gradient|₂ ≤ relative_tolerance · force_scale + absolute_tolerance.
  double relative_tolerance = 1e-9;
  double absolute_tolerance = 1e-10;  ///< N
  int max_iterations = 200;
  int lbfgs_memory = 20;
  int lbfgs_refresh = 20;       ///< iterations between factorisations
  bool certify_minimum = true;  ///< require the raw Hessian to factor at the end; else leave along negative curvature
  bool polish = false;          ///< one more raw Newton step after convergence (adjoint runs)
  void validate() const;        ///< throws ContractError naming the field
};

enum class MinimiserStatus { converged, max_iterations, line_search_failed, not_a_minimum, not_finite, interrupted };
const char* name(MinimiserStatus status);

struct MinimiserReport {
  MinimiserStatus status = MinimiserStatus::max_iterations;
  int iterations = 0, evaluations = 0, factorisations = 0, failed_factorisations = 0, negative_curvature_exits = 0;
  double energy = 0;           ///< mJ
  double residual = 0;         ///< |gradient|₂, N
  double tolerance = 0;        ///< N, what the residual was compared with
  double smallest_pivot = 0;   ///< of the last raw factor; 0 when none
  double largest_pivot = 0;
  std::vector<double> residuals;  ///< per iteration, N
  bool converged() const { return status == MinimiserStatus::converged; }
};

/// Called once per iteration; return false to stop (status interrupted).
using IterationCallback = std::function<bool(int iteration, double energy, double residual)>;

/// Minimises from q (in/out). On return with status converged and certify_minimum, `factor` holds the raw Hessian's
/// factor at (or one step before) the solution.
[[nodiscard]] MinimiserReport minimise(Objective& objective, VectorXd& q, const MinimiserOptions& options,
                                       CholeskyFactor& factor, BlockMatrix& matrix,
                                       const IterationCallback& callback = {});

}  // namespace rhytid
