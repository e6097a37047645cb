// Waves lead a fit, points decide it. Where points are out of phase their cost F_p has valleys of its own; that of points
// and waves together leads over them (wave_spectrum.h). Its minimum is not that of the points, though, and what a fit says of
// its answer (deviations, shifts, profiles, starts) is by F_p. So every search goes two ways: F_p + F_w from its start, then
// F_p alone from where that ended.
//
// Tests: tests/fitting/wave_spectrum_test.cpp
#pragma once

#include <deque>
#include <optional>

#include "fitting/fit.h"
#include "fitting/fit_logs.h"
#include "fitting/identifiability.h"
#include "fitting/stages.h"
#include "fitting/starts.h"

namespace rhytid::fitting {

class WaveLead {
 public:
  /// `input` asks for waves; its fit with them has a log in the folder `waves` of the fit's. Throws InputError when the
  /// tracks do not tell the waves.
  WaveLead(const JointFitInput& input, const FitObserver& observer);
  WaveLead(const WaveLead&) = delete;
  WaveLead& operator=(const WaveLead&) = delete;

  JointProblem& problem() { return problem_; }  ///< of points and waves
  /// `local_fit` of points and waves from a search's start, then of `points` alone from there. Where the former finds nothing,
  /// the latter begins at the start. Must not outlive this or `points`.
  LocalFit both_ways(JointProblem& points, const LocalFit& local_fit);

  /// Runs of the searches with waves among those of their starts.
  void add_runs(StartsOutcome& starts) const;
  /// The search with waves that led to the best point, among the stages.
  void add_stage(const VectorXd& best, FitResult& result) const;
  /// A sentence on how far the points alone moved the answer from where waves had led it.
  void add_note(const VectorXd& best, const Identifiability& found, FitResult& result) const;

 private:
  struct Led {
    VectorXd from_waves, end;  ///< where the search with waves ended, and that of the points after it
    FittedStage stage;
  };
  const Led* to(const VectorXd& best) const;

  JointProblem problem_;
  std::optional<FitLogs> logs_;
  std::deque<Led> led_;
};

}  // namespace rhytid::fitting
