// Backtracking along a descent direction. Internal to sim/solve.
#pragma once

#include <limits>

#include "sim/solve/objective.h"

namespace rhytid {

/// A point with its energy [mJ] and gradient [N].
struct Iterate {
  VectorXd q, gradient;
  double energy = 0;
  bool finite() const;
};

/// Evaluates energy and gradient at q.
Iterate evaluate(Objective& objective, VectorXd q);

/// Energy differences below this [mJ] are rounding: 1e-11 |E|, and for energies that cancel to near zero a
/// few rounding units of the work that the internal forces could do over the displacements.
double energy_noise(const Objective& objective, const Iterate& at);

struct LineSearchResult {
  bool accepted = false;
  double step = 0;
  int evaluations = 0;
  Iterate next;  ///< valid when accepted
};

/// From `at` along `direction` with slope = gradient·direction < 0. The first step is 1, but at most 0.9 of
/// the largest feasible one. A trial of energy E(a) is accepted by Armijo, E(a) ≤ E + 1e-4 a slope. Where
/// rounding may hide that decrease, E(a) ≤ E + noise, the gradient decides: accepted by the approximate Wolfe
/// test (Hager and Zhang 2005) 0.9 slope ≤ slope(a) ≤ (2e-4 − 1) slope, or when its norm has halved.
/// Non-finite trials shorten the step by 0.3, others by quadratic interpolation within [0.1, 0.5].
/// Gives up after `most_trials`.
LineSearchResult line_search(Objective& objective, const Iterate& at, const VectorXd& direction, double slope,
                             int most_trials = std::numeric_limits<int>::max());

/// Doubles an accepted step while at its end the energy still falls at least at 0.7 of the first rate. The
/// direction of a projected Hessian can be a hundred times too short where the true curvature is small or
/// negative along it (a film that has just buckled), and would take as many iterations.
void lengthen(Objective& objective, const Iterate& at, const VectorXd& direction, double slope,
              LineSearchResult& found);

}  // namespace rhytid
