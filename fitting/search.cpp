#include "fitting/search.h"

#include <algorithm>

#include "sim/core/error.h"

namespace rhytid::fitting {

Search::Search(Objective& objective) : Search(objective, objective.initial()) {}

Search::Search(Objective& objective, const VectorXd& start, const std::vector<int>& held)
    : objective_(objective), start_(start) {
  require(start.size() == objective.num_parameters(), "Search: one start per parameter");
  start_ = start.cwiseMax(objective.lower()).cwiseMin(objective.upper());
  for (int k = 0; k < objective.num_parameters(); ++k)
    if (std::find(held.begin(), held.end(), k) == held.end()) free_.push_back(k);
  require(!free_.empty(), "Search: nothing is free");
}

VectorXd Search::of_free(const VectorXd& all) const {
  VectorXd t(num_parameters());
  for (int k = 0; k < num_parameters(); ++k) t[k] = all[free_[k]];
  return t;
}

VectorXd Search::all(const VectorXd& t) const {
  VectorXd all = start_;
  for (int k = 0; k < num_parameters(); ++k) all[free_[k]] = t[k];
  return all;
}

std::vector<double> Search::values(const VectorXd& t) const {
  const VectorXd a = all(t);
  std::vector<double> values;
  for (int k = 0; k < objective_.num_parameters(); ++k)
    values.push_back(objective_.variables()[k].to_parameter(a[k]));
  return values;
}

const ObjectiveEvaluation& Search::evaluate(const VectorXd& t) {
  const ObjectiveEvaluation& found = objective_.evaluate(all(t));
  const bool is_known =
      std::any_of(good_.begin(), good_.end(), [&](const auto& point) { return point.second == t; });
  if (!found.failed && !is_known) {
    good_.emplace_back(found.cost, t);
    find_best();
  }
  return found;
}

std::optional<MatrixXd> Search::jacobian(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  const std::optional<MatrixXd> by_all = objective_.jacobian(all(t));
  if (!by_all) {
    forget(t);
    return std::nullopt;
  }
  MatrixXd by_free(by_all->rows(), num_parameters());
  for (int k = 0; k < num_parameters(); ++k) by_free.col(k) = by_all->col(free_[k]);
  return by_free;
}

std::optional<VectorXd> Search::gradient(const VectorXd& t) {
  if (evaluate(t).failed) return std::nullopt;
  const std::optional<VectorXd> by_all = objective_.gradient(all(t));
  if (by_all) return of_free(*by_all);
  forget(t);
  return std::nullopt;
}

void Search::forget(const VectorXd& t) {
  std::erase_if(good_, [&](const auto& point) { return point.second == t; });
  find_best();
}

void Search::find_best() {
  best_.resize(0);
  for (const auto& [cost, t] : good_)
    if (best_.size() == 0 || cost < best_cost_) {
      best_ = t;
      best_cost_ = cost;
    }
}

}  // namespace rhytid::fitting
