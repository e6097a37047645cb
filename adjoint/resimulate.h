// Solving the steps of a known run again for other parameters: same step times, warm starts from the known
// run, so that a nearby parameter costs two or three factorisations a step and stays on the same branch.
//
// The start decides how many iterations a step takes, not where it ends: every step is iterated to its
// tolerance.    Tests    tests/adjoint/sweeps_test.cpp
#pragma once

#include <functional>

#include "sim/time/simulate.h"

namespace rhytid::adjoint {

/// Displacement to start step i from, [num_nodes·3]; `before` is the state before the step.
using StartGuess = std::function<VectorXd(int step, const State& before)>;

/// After every solved step; return false to stop (the result is then incomplete).
using ResimulationObserver = std::function<bool(int step, const StepProblem& problem, const State& state)>;

/// The steps of `reference` again with `native`. Without a guess each step starts from the state before it,
/// as simulate does; a guess that cannot be evaluated or does not lead to a minimum is replaced by that
/// start. The result has the steps and frames of the reference; its states keep their history only on
/// request (needed for sweeps). Steps that do not converge are not halved: the result is then incomplete and
/// says why.
Trajectory resimulate(const Model& model, const VectorXd& native, const Trajectory& reference,
                      const MinimiserOptions& options, const StartGuess& guess = {},
                      const ResimulationObserver& observer = {}, bool keep_history = false);

/// Which smooth piece of its law every point of the given step is on, terms one after the other; laws that
/// are smooth everywhere are left out.
std::vector<signed char> step_regimes(const StepProblem& problem, const VectorXd& u);

}  // namespace rhytid::adjoint
