// Solving moment equations r(x) = 0 for the unknowns of a quadrature rule: Levenberg-Marquardt in double
// precision from a random start, then minimum-norm Newton steps in quadruple precision.
//
// A System has equations(), unknowns() and evaluate(x, residual, jacobian) with jacobian [unknown][equation].
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "tools/rules/triangle_rule_search.h"

namespace rhytid::rules {

template <typename T>
T magnitude(T x) {
  return x < T(0) ? -x : x;
}

/// Solves A x = b, A symmetric positive definite, by L D Lᵀ. False when a pivot is not positive.
template <typename T>
bool solve_positive_definite(std::vector<std::vector<T>> a, std::vector<T>& b) {
  const int n = static_cast<int>(b.size());
  for (int j = 0; j < n; ++j) {
    if (!(a[j][j] > T(0))) return false;
    for (int i = j + 1; i < n; ++i) {
      const T factor = a[i][j] / a[j][j];
      for (int k = j + 1; k <= i; ++k) a[i][k] -= factor * a[k][j];
      b[i] -= factor * b[j];
    }
  }
  for (int j = n - 1; j >= 0; --j) {
    for (int i = j + 1; i < n; ++i) b[j] -= a[i][j] * b[i];
    b[j] /= a[j][j];
  }
  return true;
}

template <typename T>
T dot(const std::vector<T>& x, const std::vector<T>& y) {
  T sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += x[i] * y[i];
  return sum;
}

/// Minimises |r|² in double precision; true when it vanishes.
template <class System>
bool levenberg_marquardt(System& system, std::vector<double>& x, int max_iterations) {
  std::vector<double> residual, trial_residual;
  std::vector<std::vector<double>> jacobian, trial_jacobian;
  system.evaluate(x, residual, jacobian);
  double cost = dot(residual, residual), damping = 1e-2;
  const int n = system.unknowns();
  for (int iteration = 0; iteration < max_iterations && cost > 1e-22; ++iteration) {
    std::vector<std::vector<double>> normal(n, std::vector<double>(n));
    std::vector<double> step(n);
    for (int i = 0; i < n; ++i) {
      step[i] = -dot(jacobian[i], residual);
      for (int j = 0; j <= i; ++j) normal[i][j] = dot(jacobian[i], jacobian[j]);
      normal[i][i] += damping;
    }
    std::vector<double> trial = x;
    double trial_cost = std::numeric_limits<double>::infinity();
    if (solve_positive_definite(normal, step)) {
      for (int i = 0; i < n; ++i) trial[i] += step[i];
      system.evaluate(trial, trial_residual, trial_jacobian);
      trial_cost = dot(trial_residual, trial_residual);
    }
    if (trial_cost < cost) {
      x = trial;
      residual = trial_residual;
      jacobian = trial_jacobian;
      cost = trial_cost;
      damping = std::max(damping * 0.2, 1e-16);
    } else {
      damping *= 5;
      if (damping > 1e8) return false;
    }
  }
  return cost < 1e-18;
}

/// Minimum-norm Newton steps dx = −Jᵀ (J Jᵀ)⁻¹ r; quadratic when the equations are independent.
template <class System>
bool polish(System& system, std::vector<Quad>& x, double& error) {
  std::vector<Quad> residual;
  std::vector<std::vector<Quad>> jacobian;
  const int n = system.equations();
  for (int iteration = 0;; ++iteration) {
    system.evaluate(x, residual, jacobian);
    Quad largest = 0;
    for (const Quad& r : residual) largest = std::max(largest, magnitude(r));
    error = static_cast<double>(largest);
    if (iteration == 8) return error < 1e-28;
    std::vector<std::vector<Quad>> gram(n, std::vector<Quad>(n, Quad(0)));
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j)
        for (const auto& column : jacobian) gram[i][j] += column[i] * column[j];
    if (!solve_positive_definite(gram, residual)) return false;
    for (int i = 0; i < system.unknowns(); ++i) x[i] -= dot(jacobian[i], residual);
  }
}

}  // namespace rhytid::rules
