#include "sim/solve/line_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace rhytid {

namespace {
constexpr double kArmijo = 1e-4;
constexpr double kSmallestStep = 1e-8;  // relative to the first
constexpr double kStillFalling = 0.7;   // of the first slope; a true Newton step ends at none
constexpr int kDoublings = 20;
}  // namespace

bool Iterate::finite() const {
  return std::isfinite(energy) && gradient.allFinite();
}

Iterate evaluate(Objective& objective, VectorXd q) {
  Iterate result;
  result.gradient = VectorXd::Zero(q.size());
  result.energy = objective.energy(q, &result.gradient);
  result.q = std::move(q);
  return result;
}

double energy_noise(const Objective& objective, const Iterate& at) {
  return 1e-11 * std::abs(at.energy) + 1e-15 * objective.force_scale() * at.q.cwiseAbs().maxCoeff();
}

LineSearchResult line_search(Objective& objective, const Iterate& at, const VectorXd& direction, double slope,
                             int most_trials) {
  LineSearchResult result;
  const double noise = energy_noise(objective, at);
  const double first = std::min(1.0, 0.9 * objective.largest_feasible_step(at.q, direction));
  // Not `while (step >= ...)` alone: a first step of zero or NaN must end here too.
  for (double step = first; step > 0 && step >= kSmallestStep * first && result.evaluations < most_trials;) {
    result.next = evaluate(objective, at.q + step * direction);
    ++result.evaluations;
    result.step = step;
    if (!result.next.finite()) {
      step *= 0.3;
      continue;
    }
    const double change = result.next.energy - at.energy;
    result.accepted = change <= kArmijo * step * slope;
    if (!result.accepted && change <= noise) {
      const double slope_there = result.next.gradient.dot(direction);
      result.accepted = (0.9 * slope <= slope_there && slope_there <= (2 * kArmijo - 1) * slope) ||
                        result.next.gradient.norm() <= 0.5 * at.gradient.norm();
    }
    if (result.accepted) return result;
    // Minimum of the parabola through E, slope and E(step).
    const double parabola = -slope * step * step / (2 * (change - step * slope));
    step = std::isfinite(parabola) ? std::clamp(parabola, 0.1 * step, 0.5 * step) : 0.3 * step;
  }
  return result;
}

void lengthen(Objective& objective, const Iterate& at, const VectorXd& direction, double slope,
              LineSearchResult& found) {
  const double limit = 0.9 * objective.largest_feasible_step(at.q, direction);
  for (int doubling = 0; doubling < kDoublings && 2 * found.step <= limit; ++doubling) {
    if (found.next.gradient.dot(direction) > kStillFalling * slope) return;
    Iterate trial = evaluate(objective, at.q + 2 * found.step * direction);
    ++found.evaluations;
    if (!trial.finite() || !(trial.energy < found.next.energy)) {
      // The objective keeps data of its last evaluation (force scale): leave it at the point returned.
      objective.energy(found.next.q, &found.next.gradient);
      ++found.evaluations;
      return;
    }
    found.next = std::move(trial);
    found.step *= 2;
  }
}

}  // namespace rhytid
