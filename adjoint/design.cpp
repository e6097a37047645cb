#include "adjoint/design.h"

#include <algorithm>
#include <cmath>

#include "adjoint/directions.h"
#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

bool holds(const std::vector<int>& list, int item) {
  return std::find(list.begin(), list.end(), item) != list.end();
}

std::vector<int> with(std::vector<int> list, int item) {
  list.push_back(item);
  return list;
}

}  // namespace

const char* name(DesignCriterion criterion) {
  return criterion == DesignCriterion::d_optimality ? "D" : "A";
}

MatrixXd Posterior::correlation() const {
  const VectorXd inverse = deviations().cwiseInverse();
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

Posterior posterior(const std::vector<MatrixXd>& roots, const std::vector<int>& chosen,
                    const VectorXd& prior_deviations) {
  const Eigen::Index n = prior_deviations.size();
  require(prior_deviations.allFinite() && (prior_deviations.array() > 0).all(),
          "posterior: priors must be positive and finite");
  MatrixXd root = prior_deviations.cwiseInverse().asDiagonal();
  for (const int e : chosen) {
    require(e >= 0 && e < static_cast<int>(roots.size()) && roots[e].cols() == n,
            "posterior: an experiment with other parameters");
    root = stacked_root(root, roots[e]);
  }
  const MatrixXd inverse = root.triangularView<Eigen::Upper>().solve(MatrixXd::Identity(n, n));
  Posterior result;
  result.covariance = inverse * inverse.transpose();
  result.trace = result.covariance.trace();
  result.log_det = 0 - 2 * root.diagonal().cwiseAbs().array().log().sum();
  return result;
}

double information_gain_bits(const Posterior& posterior, const VectorXd& prior_deviations) {
  const double prior = 2 * prior_deviations.array().log().sum();
  return 0.5 * (prior - posterior.log_det) / std::log(2.0);
}

std::vector<DesignStep> greedy_design(const std::vector<MatrixXd>& roots, const VectorXd& prior_deviations,
                                      DesignCriterion criterion, const std::vector<int>& done, int steps) {
  std::vector<DesignStep> plan;
  std::vector<int> chosen = done;
  while (static_cast<int>(plan.size()) < steps) {
    DesignStep best{-1, 0};
    for (int e = 0; e < static_cast<int>(roots.size()); ++e) {
      if (holds(chosen, e)) continue;
      const double value = posterior(roots, with(chosen, e), prior_deviations).value(criterion);
      if (best.experiment < 0 || value < best.value) best = {e, value};
    }
    if (best.experiment < 0) break;
    chosen.push_back(best.experiment);
    plan.push_back(best);
  }
  return plan;
}

std::vector<DesignPair> ranked_pairs(const std::vector<MatrixXd>& roots, const VectorXd& prior_deviations,
                                     DesignCriterion criterion, const std::vector<int>& done) {
  std::vector<DesignPair> pairs;
  for (int a = 0; a < static_cast<int>(roots.size()); ++a)
    for (int b = a + 1; b < static_cast<int>(roots.size()); ++b)
      if (!holds(done, a) && !holds(done, b))
        pairs.push_back({a, b, posterior(roots, with(with(done, a), b), prior_deviations).value(criterion)});
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const DesignPair& a, const DesignPair& b) { return a.value < b.value; });
  return pairs;
}

}  // namespace rhytid::adjoint
