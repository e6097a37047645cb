#include "sim/element/quadrature.h"

#include <cmath>
#include <numbers>

#include "sim/core/error.h"

namespace rhytid {
namespace {

struct StoredPoint {
  int degree;
  const char* name;
  double u, v, weight;
};

constexpr StoredPoint stored_points[] = {
#include "sim/element/triangle_rules.inc"
};

std::vector<TriangleRule> stored_rules() {
  std::vector<TriangleRule> rules;
  for (const StoredPoint& point : stored_points) {
    if (rules.empty() || rules.back().degree != point.degree) rules.push_back({point.name, point.degree, {}});
    rules.back().points.push_back({point.u, point.v, point.weight});
  }
  return rules;
}

}  // namespace

const TriangleRule& triangle_rule(int degree) {
  static const std::vector<TriangleRule> rules = stored_rules();
  require(degree >= 1, "triangle_rule: the degree must be at least 1");
  for (const TriangleRule& rule : rules)
    if (rule.degree >= degree) return rule;
  throw ContractError("triangle_rule: degree " + std::to_string(degree) +
                      " is above the highest stored degree " + std::to_string(rules.back().degree));
}

std::vector<LinePoint> gauss_legendre(int num_points) {
  require(num_points >= 1 && num_points <= 16, "gauss_legendre: the number of points must be 1..16");
  const int n = num_points;
  std::vector<LinePoint> points(n);
  // Roots of P_n from the asymptotic guess cos π(i + 3/4)/(n + 1/2), by Newton on the three-term recurrence;
  // extended precision so that the results are the nearest doubles but for rare ties.
  for (int i = 0; i < (n + 1) / 2; ++i) {
    long double x = 2 * i + 1 == n ? 0 : std::cos(std::numbers::pi_v<long double> * (i + 0.75L) / (n + 0.5L));
    long double slope = 0;
    for (int iteration = 0; iteration < 20; ++iteration) {
      long double previous = 0, current = 1;
      for (int m = 0; m < n; ++m) {
        const long double next = ((2 * m + 1) * x * current - m * previous) / (m + 1);
        previous = current;
        current = next;
      }
      slope = n * (previous - x * current) / (1 - x * x);
      const long double step = current / slope;
      x -= step;
      if (std::abs(step) < 1e-17L) break;
    }
    const long double weight = 2 / ((1 - x * x) * slope * slope);
    points[n - 1 - i] = {static_cast<double>(x), static_cast<double>(weight)};
    points[i] = {static_cast<double>(-x), static_cast<double>(weight)};
  }
  return points;
}

}  // namespace rhytid
