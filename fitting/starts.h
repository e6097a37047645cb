// A fit from several starts. A local search ends in the valley that it began in; searches from seeded points
// about the case's own start show whether there are others, and whether the footage tells them apart.
//
//   box     |t_k − t_k,initial| <= spread · u_k within the bounds;  u_k = 1 (log, logit) or a quarter of the
//           range (none),
//           the prior's deviation for what moves several of the scene's parameters (path_deviations.h)
//   points  start 0 is the case's own, start i the i-th point of a Halton sequence with permuted digits and a
//           random shift, so that more starts keep those of before
//
// Every start is screened by one run on the early frames, and searches begin at the case's own start and at
// those of the others that cost least there. Which runs are made follows from seed and costs alone: with a
// log (evaluation_log.h) a fit that was killed goes on to the same bits.
//
// Source   J. H. Halton, Numer. Math. 2 (1960) 84–90; permuted digits: H. Faure, J. Number Theory 42 (1992)
// Tests    tests/fitting/starts_test.cpp
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "fitting/fit.h"

namespace rhytid::fitting {

struct StartOptions {
  int starts = 1;      ///< with the case's own
  int local_fits = 3;  ///< searches at most, that from the case's own start among them
  double spread = 1;   ///< half width of the box in units u_k
  unsigned seed = 1;
  VectorXd first = {};  ///< where start 0 is instead of the objective's initial point; empty: there
};

/// The first is options.first or the objective's initial point; transformed, within the bounds. Throws ContractError unless
/// starts, local_fits and spread are positive.
std::vector<VectorXd> start_points(const Objective& objective, const StartOptions& options);

/// What was found from one start.
struct SearchedStart {
  VectorXd t;            ///< where it begins
  double screened_cost;  ///< NaN: not screened, or the run failed
  std::string failure;   ///< of the run that screened it
  bool was_searched = false;
  OptimiserOutcome outcome;  ///< when it was; evaluations of its history are counted from its beginning
  int forward_runs = 0;      ///< of the search
};

struct StartsOutcome {
  std::vector<SearchedStart> starts;  ///< as start_points; only the first when there is one
  int winner = 0;                     ///< lowest cost, the first of equal ones; 0 when no run succeeded
  int screening_runs = 0;             ///< that the objective itself does not count
  int screened_frames = 0;            ///< last frame that starts were compared on; 0: there was one start
  const OptimiserOutcome& best() const { return starts[winner].outcome; }
};

/// Screens by `screen`, which has the parameters of `objective` and may be the same, then searches. Ends
/// early, with the search under way as winner, when an objective is stopped. `tell` (may be empty) hears one
/// line per step.
StartsOutcome search_from_starts(Objective& screen, Objective& objective, const StartOptions& options,
                                 const LocalFit& local_fit,
                                 const std::function<void(const std::string&)>& tell = {});

/// The same for a fit: screens on the early frames (`/fit/screen_frames`) in a problem of its own, with a log
/// of its own in the folder `screen` of the fit's. Runs told to the observer are counted through.
/// `first` is start 0, about which the others lie.
StartsOutcome fit_from_starts(const JointFitInput& input, JointProblem& problem, const VectorXd& first,
                              const LocalFit& local_fit, const FitObserver& observer);

/// Starts, optima, and sentences about them into the result, whose parameters are those of the winner.
/// `widening` is that of its deviations: another optimum is as good where it costs less than 2 w² more.
void add_starts(const JointProblem& problem, const StartsOutcome& found, const FitCase& options,
                double widening, FitResult& result);

}  // namespace rhytid::fitting
