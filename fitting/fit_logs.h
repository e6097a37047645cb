// The logs of evaluations of all clips of a fit (evaluation_log.h), attached to its problem while they live.
#pragma once

#include <deque>
#include <functional>
#include <string>

#include "fitting/fit.h"

namespace rhytid::fitting {

class FitLogs {
 public:
  /// Opens those of `input.evaluations`, none when that is empty: the folder itself for a fit of one clip,
  /// one of each clip's name in there for several. `note` (may be empty) hears in one line each what became
  /// of older ones. The problem must not be evaluated once these are gone. Throws InputError when a folder
  /// cannot be made.
  FitLogs(const JointFitInput& input, JointProblem& problem,
          const std::function<void(const std::string&)>& note);
  FitLogs(const FitLogs&) = delete;
  FitLogs& operator=(const FitLogs&) = delete;

 private:
  std::deque<EvaluationLog> logs_;
};

}  // namespace rhytid::fitting
