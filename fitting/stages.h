// Cheaper fits before a fit: coarse elements and long steps, or the first frames only. Each begins where the one
// before ended, the fit itself where the last one did, so that most of the way is gone at a fraction of its cost.
//
// A stage has the tracks, parameters, bounds and priors of the fit; its scene differs by settings. A stage that fails
// or ends at a bound hands on what it was given.
//
// Tests: tests/fitting/stages_test.cpp
#pragma once

#include <functional>
#include <vector>

#include "fitting/fit.h"

namespace rhytid::fitting {

/// What the stages made of the fit's initial values.
struct StagesOutcome {
  VectorXd start;  ///< where the fit begins: transformed, within its bounds
  std::vector<FittedStage> stages;
  bool was_stopped = false;  ///< by the observer
};

/// A local search of an objective that ends after so many evaluations at most.
using StageFit = std::function<OptimiserOutcome(Search&, int max_evaluations)>;

/// Runs the stages of `input`, none when it has none, each with a log in the folder `stage_N` of the fit's. Throws
/// InputError naming the stage when its scene does not go with the tracks or the parameters.
StagesOutcome run_stages(const JointFitInput& input, const JointProblem& problem, const StageFit& local_fit,
                         const FitObserver& observer);

/// The better of the fit's initial values and what the stages made of them, by a run of the fit at each: a stage of
/// the first frames may end anywhere in what they do not determine. Says so in the last stage's status.
VectorXd better_start(JointProblem& problem, StagesOutcome& found);

}  // namespace rhytid::fitting
