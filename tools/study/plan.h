// Planning what to film: each swipe of a list is run once with its tangent, and the posterior that its tracks
// would leave follows to first order, before there is any footage.
// Tests: tests/tools/study_gradients_test.cpp; the criteria: tests/adjoint/design_test.cpp
#pragma once

#include <string>
#include <vector>

#include "adjoint/design.h"
#include "adjoint/parameter_space.h"
#include "sim/scene/parameter.h"
#include "tools/study/experiment.h"
#include "tools/study/study_run.h"
#include "tools/verb.h"

namespace rhytid::tools {

struct PlanOptions {
  std::vector<std::string> only;       ///< swipes; empty = all
  std::vector<std::string> addresses;  ///< empty = all that all swipes have, with the same value
  PredictedTracks tracks;
  double prior = 1;                 ///< standard deviation of every coordinate before any footage
  std::vector<std::string> priors;  ///< "ADDRESS=deviation", in place of that; each address once
  std::vector<std::string> filmed;  ///< swipes that have been filmed already
  bool anew = false;
};

struct Plan {
  std::vector<std::string> swipes;               ///< those that could be run
  std::vector<ParameterSpec> parameters;         ///< with their values, the same in all swipes
  std::vector<adjoint::Coordinate> coordinates;  ///< of `parameters`
  VectorXd priors;                               ///< [parameters]
  std::vector<MatrixXd> roots;                   ///< per swipe, whitened
  std::vector<int> filmed;                       ///< indices
  std::vector<std::string> left_out;             ///< swipes and why
};

/// Runs what is missing and writes what it says. Throws InputError.
ExitCode run_plan(VerbContext& context, const Experiment& experiment, const PlanOptions& options);

/// Names of the files that write_plan leaves in its folder, which no swipe may have.
const std::vector<std::string>& plan_files();

/// swipes.csv, pairs.csv, order.csv, posterior.svg, plan.txt, index.html. Returns the text of plan.txt.
std::string write_plan(const std::string& folder, const Experiment& experiment, const Plan& plan,
                       const PlanOptions& options);

}  // namespace rhytid::tools
