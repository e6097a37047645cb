#include "tools/rules/triangle_rule_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "tools/rules/invariant_basis.h"
#include "tools/rules/moment_solver.h"

namespace rhytid::rules {
namespace {

// Residuals rₖ = Σ wᵢ φₖ(xᵢ) − δₖ₀ and their Jacobian; weights here sum to 1.
// Unknowns: centroid [w]; median orbits [w, a] at (a, a, 1−2a); general orbits [w, a, b] at (a, b, 1−a−b).
template <typename T>
class MomentSystem {
 public:
  MomentSystem(const InvariantBasis& basis, const OrbitStructure& structure)
      : basis_(basis), structure_(structure) {}
  int equations() const { return basis_.size(); }
  int unknowns() const { return structure_.unknowns(); }

  // jacobian: [unknown][equation]
  void evaluate(const std::vector<T>& x, std::vector<T>& residual, std::vector<std::vector<T>>& jacobian) {
    const int n = equations();
    residual.assign(n, T(0));
    residual[0] = T(-1);
    jacobian.assign(unknowns(), std::vector<T>(n));
    int at = 0;
    const auto add = [&](int points, int coordinates, T a, T b) {
      basis_.evaluate(a, b, phi_);
      const T weight = x[at];
      for (int k = 0; k < n; ++k) {
        residual[k] += T(points) * weight * phi_.value[k];
        jacobian[at][k] = T(points) * phi_.value[k];
        if (coordinates == 1) jacobian[at + 1][k] = T(points) * weight * (phi_.d_da[k] + phi_.d_db[k]);
        if (coordinates == 2) {
          jacobian[at + 1][k] = T(points) * weight * phi_.d_da[k];
          jacobian[at + 2][k] = T(points) * weight * phi_.d_db[k];
        }
      }
      at += 1 + coordinates;
    };
    for (int i = 0; i < structure_.centroid; ++i) add(1, 0, T(1) / 3, T(1) / 3);
    for (int i = 0; i < structure_.median; ++i) add(3, 1, x[at + 1], x[at + 1]);
    for (int i = 0; i < structure_.general; ++i) add(6, 2, x[at + 1], x[at + 2]);
  }

 private:
  const InvariantBasis& basis_;
  OrbitStructure structure_;
  InvariantValues<T> phi_;
};

std::vector<double> random_start(const OrbitStructure& structure, std::mt19937_64& random) {
  const auto uniform = [&random] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  const auto weight = [&] { return (0.5 + uniform()) / structure.points(); };
  std::vector<double> x;
  for (int i = 0; i < structure.centroid; ++i) x.push_back(weight());
  for (int i = 0; i < structure.median; ++i) x.insert(x.end(), {weight(), 0.5 * uniform()});
  for (int i = 0; i < structure.general; ++i) {
    double a = uniform(), b = uniform();
    if (a + b > 1) a = 1 - a, b = 1 - b;
    x.insert(x.end(), {weight(), a, b});
  }
  return x;
}

// Points on the reference triangle, orbit by orbit; false unless weights are positive and points inside.
bool expand(const OrbitStructure& structure, const std::vector<Quad>& x, double min_margin,
            DerivedRule& rule) {
  rule.points.clear();
  Quad margin = 1;
  int at = 0;
  bool positive = true;
  const auto add = [&](int coordinates, Quad a, Quad b) {
    const Quad c = 1 - a - b, weight = x[at] / 2;
    positive = positive && weight > 0;
    margin = std::min({margin, a, b, c});
    if (coordinates == 0) rule.points.push_back({a, b, weight});
    if (coordinates == 1)
      for (const auto& [u, v] : {std::array{a, a}, {c, a}, {a, c}}) rule.points.push_back({u, v, weight});
    if (coordinates == 2)
      for (const auto& [u, v] : {std::array{a, b}, {b, a}, {b, c}, {c, b}, {c, a}, {a, c}})
        rule.points.push_back({u, v, weight});
    at += 1 + coordinates;
  };
  for (int i = 0; i < structure.centroid; ++i) add(0, Quad(1) / 3, Quad(1) / 3);
  for (int i = 0; i < structure.median; ++i) add(1, x[at + 1], x[at + 1]);
  for (int i = 0; i < structure.general; ++i) add(2, x[at + 1], x[at + 2]);
  rule.margin = static_cast<double>(margin);
  return positive && rule.margin > min_margin;
}

// Orbits that have merged (or a general orbit fallen on a median) make a rule of fewer points in disguise.
bool has_coincident_points(const DerivedRule& rule) {
  for (std::size_t i = 0; i < rule.points.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (magnitude(rule.points[i].u - rule.points[j].u) < Quad(1e-8) &&
          magnitude(rule.points[i].v - rule.points[j].v) < Quad(1e-8))
        return true;
  return false;
}

}  // namespace

std::string OrbitStructure::name() const {
  std::string text;
  if (centroid > 0) text += "C" + std::to_string(centroid);
  if (median > 0) text += "M" + std::to_string(median);
  if (general > 0) text += "G" + std::to_string(general);
  return text;
}

std::string DerivedRule::name() const {
  return "tri" + std::to_string(degree) + "-" + std::to_string(points.size());
}

std::optional<DerivedRule> derive_triangle_rule(int degree, const SearchOptions& options) {
  const int equations = InvariantBasis::count(degree);
  const int seen_by_general_only = degree >= 6 ? InvariantBasis::count(degree - 6) : 0;
  std::vector<OrbitStructure> structures;
  for (int c = 0; c <= 1; ++c)
    for (int g = 0; 6 * g <= options.max_points; ++g)
      for (int m = 0; c + 3 * m + 6 * g <= options.max_points; ++m)
        if (c + 2 * m + 3 * g >= equations && 3 * g >= seen_by_general_only) structures.push_back({c, m, g});
  std::stable_sort(structures.begin(), structures.end(),
                   [](const OrbitStructure& l, const OrbitStructure& r) { return l.points() < r.points(); });

  const InvariantBasis basis(degree);
  std::mt19937_64 random(options.seed);
  for (const OrbitStructure& structure : structures) {
    MomentSystem<double> system(basis, structure);
    MomentSystem<Quad> fine_system(basis, structure);
    std::optional<DerivedRule> best;
    int converged = 0;
    for (int start = 0; start < options.starts && converged < options.keep; ++start) {
      std::vector<double> x = random_start(structure, random);
      if (!levenberg_marquardt(system, x, options.max_iterations)) continue;
      DerivedRule rule;
      rule.degree = degree;
      rule.structure = structure;
      std::vector<Quad> fine(x.begin(), x.end());
      if (!expand(structure, fine, options.min_margin, rule)) continue;
      if (!polish(fine_system, fine, rule.residual)) continue;
      if (!expand(structure, fine, options.min_margin, rule) || has_coincident_points(rule)) continue;
      ++converged;
      if (!best || rule.margin > best->margin) best = rule;
    }
    if (best) {
      best->converged = converged;
      return best;
    }
  }
  return std::nullopt;
}

std::string to_decimal(Quad x, int digits) {
  Quad half = Quad(1) / 2;
  for (int i = 0; i < digits; ++i) half /= 10;
  x += half;
  std::string text = "0.";
  for (int i = 0; i < digits; ++i) {
    x *= 10;
    const int digit = static_cast<int>(x);
    text += static_cast<char>('0' + digit);
    x -= digit;
  }
  return text;
}

}  // namespace rhytid::rules
