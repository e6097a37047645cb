// The whole fit: problem, optimiser, intervals, record.
// Tests: tests/fitting/fit_test.cpp
#pragma once

#include <functional>
#include <map>
#include <string>

#include "fitting/case.h"
#include "fitting/fit_result.h"
#include "fitting/joint_problem.h"
#include "fitting/optimise.h"

namespace rhytid::fitting {

struct FitInput {
  Scene scene;
  Camera camera;
  TrackSet tracks;
  FitCase options;
  /// Address by names → value, internal units; empty for real footage. Where the truth's gauge modulus is not
  /// the one held, stiffnesses are compared per unit of it (the footage cannot tell more).
  std::map<std::string, double> truth;
  /// Folder of the log of evaluations (evaluation_log.h) that lets an interrupted fit be resumed; empty:
  /// none.
  std::string evaluations = {};
  bool anew = false;               ///< do not use what the log already holds
  std::vector<Scene> stages = {};  ///< of each of `options.stages`
};

/// Several clips, fitted together.
struct JointFitInput {
  std::vector<FitClip> clips;
  FitCase options;
  std::vector<std::vector<Scene>> stages = {};  ///< of each of `options.stages`, the clips' scenes
  std::map<std::string, double> truth = {};     ///< as FitInput::truth, by addresses of the joint problem
  /// As FitInput::evaluations; of several clips each has a folder of its name in there.
  std::string evaluations = {};
  bool anew = false;
  /// How paths of colliders may be off, σ = 1 each, and sentences about it (path_deviations.h); run_fit fills them in.
  std::vector<FitParameter> path_errors = {};
  std::vector<std::string> path_notes = {};
};

struct FitObserver {
  std::function<void(const FitProgress&)> run;         ///< after every forward run
  std::function<void(const FitIteration&)> iteration;  ///< after every iteration of the optimiser
  std::function<void(const FitProblem&)> registered;   ///< once per clip, before the first run
  std::function<bool()> should_stop;                   ///< polled inside runs
  std::function<void(const std::string&)> note;        ///< what became of the log of evaluations, one line
};

/// Fits. Fields of the result about files and the case are left to the caller. Throws InputError for a case
/// that cannot be fitted; a forward model that fails or an optimiser that runs out is a status.
FitResult run_fit(const FitInput& input, const FitObserver& observer = {});
FitResult run_fit(const JointFitInput& input, const FitObserver& observer = {});

/// Truth values from the truth.json that `rhytid render` writes: {"parameters": [{"address", "value"}, ...]},
/// addresses by names, internal units. Addresses that the scene does not have are left out. Throws InputError
/// on anything malformed.
std::map<std::string, double> read_truth(const std::string& path, const Scene& scene);

/// The answer as text: a table of parameter, initial, fitted, 95 % interval and, where known, truth, error
/// and whether the interval holds it; then what the footage does not tell.
std::string answer_text(const FitResult& result);

}  // namespace rhytid::fitting
