#include "sim/element/quadrature.h"

#include <algorithm>
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

struct StoredPrismPoint {
  int degree;
  const char* name;
  double u, v, w, weight;
};

constexpr StoredPrismPoint stored_prism_points[] = {
#include "sim/element/prism_rules.inc"
};

std::vector<PrismRule> stored_prism_rules() {
  std::vector<PrismRule> rules;
  PrismRule sheet = tensor_rule(triangle_rule(1), 2);
  sheet.degree = 1;
  rules.push_back(std::move(sheet));
  for (const StoredPrismPoint& point : stored_prism_points) {
    if (rules.back().degree != point.degree) rules.push_back({point.name, point.degree, {}});
    rules.back().points.push_back({point.u, point.v, point.w, point.weight});
  }
  return rules;
}

}  // namespace

const PrismRule& prism_rule(int degree) {
  static const std::vector<PrismRule> rules = stored_prism_rules();
  require(degree >= 1, "prism_rule: the degree must be at least 1");
  for (const PrismRule& rule : rules)
    if (rule.degree >= degree) return rule;
  throw ContractError("prism_rule: degree " + std::to_string(degree) +
                      " is above the highest stored degree " + std::to_string(rules.back().degree));
}

PrismRule tensor_rule(const TriangleRule& triangle, int num_points) {
  PrismRule rule{triangle.name + " x GL" + std::to_string(num_points),
                 std::min(triangle.degree, 2 * num_points - 1),
                 {},
                 num_points};
  const std::vector<LinePoint> line = gauss_legendre(num_points);
  for (const TrianglePoint& t : triangle.points)
    for (const LinePoint& l : line) rule.points.push_back({t.u, t.v, l.w, t.weight * l.weight});
  return rule;
}

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
