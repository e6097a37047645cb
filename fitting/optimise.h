// The optimisers of a fit: Ceres (Levenberg-Marquardt on the tangent Jacobian) and NLopt (bounded SLSQP on
// the adjoint gradient). Both minimise the same F(t) of an objective within its bounds.
// Tests: tests/fitting/fit_test.cpp
#pragma once

#include <functional>
#include <string>

#include "fitting/fit_result.h"
#include "fitting/search.h"

namespace rhytid::fitting {

struct OptimiserOptions {
  int max_evaluations = 30;  ///< forward runs
  /// Converged when a step lowers F by less than this part of it. At F of some thousands (one half per
  /// observed number) 1e-6 is far below the statistical scale of ½; less only buys runs that change nothing.
  double relative_decrease = 1e-6;
  double step_tolerance = 1e-7;  ///< on t, relative to |t|
};

struct OptimiserOutcome {
  enum class Status { converged, max_evaluations, stopped, failed };
  Status status = Status::failed;
  std::string detail;  ///< a sentence
  VectorXd t;          ///< the best point seen, all parameters; the start when every run failed
  double cost = 0;     ///< F there; infinite when every run failed
  std::vector<FitIteration> history;
};

/// Called after every accepted or rejected iteration of the optimiser.
using FitIterationCallback = std::function<void(const FitIteration&)>;

/// A local search to its end, by whichever optimiser.
using LocalFit = std::function<OptimiserOutcome(Search&)>;

/// One Ceres cost function for the whole objective: the Jacobian is formed only when asked for, a failed
/// forward run shrinks the trust region.
OptimiserOutcome fit_with_ceres(Search& search, const OptimiserOptions& options,
                                const FitIterationCallback& callback = {});

/// SLSQP over variables scaled by the initial Jacobian's column norms; a failed run counts as a wall that
/// pushes back to the best point.
OptimiserOutcome fit_with_nlopt(Search& search, const OptimiserOptions& options,
                                const FitIterationCallback& callback = {});

}  // namespace rhytid::fitting
