// One local search of an optimiser: where it starts, which parameters are held meanwhile, and the best point
// it has seen. Points t of a search are the free parameters only.
// Tests: tests/fitting/fit_test.cpp, tests/fitting/resume_test.cpp
#pragma once

#include <utility>
#include <vector>

#include "fitting/objective.h"

namespace rhytid::fitting {

class Search {
 public:
  /// From the objective's initial values, everything free.
  explicit Search(Objective& objective);
  /// `start` [num_parameters] of the objective is brought into the bounds; `held` lists parameters that keep
  /// its values. The objective must outlive the search. Throws ContractError when all are held.
  Search(Objective& objective, const VectorXd& start, const std::vector<int>& held = {});

  int num_parameters() const { return static_cast<int>(free_.size()); }
  int num_residuals() const { return objective_.num_residuals(); }
  VectorXd initial() const { return of_free(start_); }
  VectorXd lower() const { return of_free(objective_.lower()); }
  VectorXd upper() const { return of_free(objective_.upper()); }

  const ObjectiveEvaluation& evaluate(const VectorXd& t);
  /// By the free parameters, as Objective has them. A point without derivative is never the best.
  std::optional<MatrixXd> jacobian(const VectorXd& t);
  std::optional<VectorXd> gradient(const VectorXd& t);

  /// All parameters of the objective at t, transformed.
  VectorXd all(const VectorXd& t) const;
  /// The same in internal units.
  std::vector<double> values(const VectorXd& t) const;

  int forward_runs() const { return objective_.forward_runs(); }
  bool was_stopped() const { return objective_.was_stopped(); }
  const std::string& last_failure() const { return objective_.last_failure(); }
  /// Lowest cost of this search so far and where; empty vector before the first that did not fail.
  const VectorXd& best() const { return best_; }
  double best_cost() const { return best_cost_; }

 private:
  VectorXd of_free(const VectorXd& all) const;
  void forget(const VectorXd& t);
  void find_best();

  Objective& objective_;
  VectorXd start_;
  std::vector<int> free_;
  std::vector<std::pair<double, VectorXd>> good_;  ///< cost and t
  VectorXd best_;
  double best_cost_ = 0;
};

}  // namespace rhytid::fitting
