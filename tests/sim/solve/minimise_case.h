// What tests of the minimisers share: a problem solved with a factor and a matrix of its own.
#pragma once

#include <random>
#include <utility>

#include "sim/solve/minimise.h"
#include "tests/sim/solve/clique_objective.h"

namespace rhytid {

struct Outcome {
  MinimiserReport report;
  VectorXd q;
  CholeskyFactor factor;
  BlockMatrix matrix;
};

inline Outcome solve(Objective& objective, VectorXd q, const MinimiserOptions& options,
                     const IterationCallback& callback = {}) {
  Outcome result{{}, std::move(q), CholeskyFactor(objective.pattern()), BlockMatrix(objective.pattern())};
  result.report = minimise(objective, result.q, options, result.factor, result.matrix, callback);
  return result;
}

inline VectorXd random_vector(int n, double low, double high) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(low, high);
  return VectorXd::NullaryExpr(n, [&] { return uniform(random); });
}

inline constexpr Minimiser kAll[] = {Minimiser::newton, Minimiser::newton_projected, Minimiser::lbfgs};

}  // namespace rhytid
