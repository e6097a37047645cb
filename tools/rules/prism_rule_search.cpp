#include "tools/rules/prism_rule_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "tools/rules/invariant_basis.h"
#include "tools/rules/moment_solver.h"

namespace rhytid::rules {
namespace {

/// One orbit: how many triangle coordinates are unknown, and whether it is a mirrored pair.
struct Orbit {
  int coordinates;
  bool is_pair;
  int triangle_points() const { return coordinates == 0 ? 1 : coordinates == 1 ? 3 : 6; }
  int points() const { return triangle_points() * (is_pair ? 2 : 1); }
  int unknowns() const { return 1 + coordinates + (is_pair ? 1 : 0); }
};

std::vector<Orbit> orbits_of(const PrismStructure& s) {
  std::vector<Orbit> orbits;
  const auto add = [&orbits](int count, int coordinates, bool is_pair) {
    for (int i = 0; i < count; ++i) orbits.push_back({coordinates, is_pair});
  };
  add(s.centroid_mid, 0, false);
  add(s.centroid_pair, 0, true);
  add(s.median_mid, 1, false);
  add(s.median_pair, 1, true);
  add(s.general_mid, 2, false);
  add(s.general_pair, 2, true);
  return orbits;
}

/// Even Legendre polynomials L₀, L₂, ... at w, normalised to mean square 1 over [−1, 1], and their
/// derivatives.
template <typename T>
void even_legendre(T w, int count, const std::vector<Quad>& scales, std::vector<T>& value,
                   std::vector<T>& slope) {
  value.assign(count, T(1));
  slope.assign(count, T(0));
  T previous = 1, current = w, previous_slope = 0, current_slope = 1;
  for (int n = 1; n + 1 <= 2 * (count - 1); ++n) {
    const T next = (T(2 * n + 1) * w * current - T(n) * previous) / T(n + 1);
    const T next_slope = previous_slope + T(2 * n + 1) * current;
    previous = current;
    current = next;
    previous_slope = current_slope;
    current_slope = next_slope;
    if ((n + 1) % 2 == 0) {
      value[(n + 1) / 2] = static_cast<T>(scales[(n + 1) / 2]) * next;
      slope[(n + 1) / 2] = static_cast<T>(scales[(n + 1) / 2]) * next_slope;
    }
  }
}

/// Residuals Σ wᵢ φₖ(xᵢ) L₂ₘ(zᵢ) − δ and their Jacobian; weights here sum to 1. Unknowns per orbit: weight,
/// then its triangle coordinates, then z of a pair.
template <typename T>
class PrismMoments {
 public:
  PrismMoments(const InvariantBasis& basis, int degree, const std::vector<Orbit>& orbits)
      : basis_(basis), orbits_(orbits), heights_(degree / 2 + 1) {
    for (int k = 0; k < basis.size(); ++k)
      for (int m = 0; basis.degree_of(k) + 2 * m <= degree; ++m) products_.push_back({k, m});
    for (int m = 0; m < heights_; ++m) scales_.push_back(square_root(4 * m + 1));
    for (const Orbit& orbit : orbits) unknowns_ += orbit.unknowns();
  }
  int equations() const { return static_cast<int>(products_.size()); }
  int unknowns() const { return unknowns_; }

  void evaluate(const std::vector<T>& x, std::vector<T>& residual, std::vector<std::vector<T>>& jacobian) {
    const int n = equations();
    residual.assign(n, T(0));
    residual[0] = T(-1);
    jacobian.assign(unknowns_, std::vector<T>(n));
    int at = 0;
    for (const Orbit& orbit : orbits_) {
      const T weight = x[at], points = T(orbit.points());
      const T a = orbit.coordinates == 0 ? T(1) / 3 : x[at + 1];
      const T b = orbit.coordinates == 2 ? x[at + 2] : a;
      const int at_z = at + 1 + orbit.coordinates;
      const T z = orbit.is_pair ? x[at_z] : T(0);
      basis_.evaluate(a, b, phi_);
      even_legendre(z, heights_, scales_, value_, slope_);
      for (int e = 0; e < n; ++e) {
        const auto [k, m] = products_[e];
        const T l = value_[m];
        residual[e] += points * weight * phi_.value[k] * l;
        jacobian[at][e] = points * phi_.value[k] * l;
        if (orbit.coordinates == 1) jacobian[at + 1][e] = points * weight * (phi_.d_da[k] + phi_.d_db[k]) * l;
        if (orbit.coordinates == 2) {
          jacobian[at + 1][e] = points * weight * phi_.d_da[k] * l;
          jacobian[at + 2][e] = points * weight * phi_.d_db[k] * l;
        }
        if (orbit.is_pair) jacobian[at_z][e] = points * weight * phi_.value[k] * slope_[m];
      }
      at += orbit.unknowns();
    }
  }

 private:
  const InvariantBasis& basis_;
  std::vector<Orbit> orbits_;
  int heights_, unknowns_ = 0;
  std::vector<std::array<int, 2>> products_;  ///< (k, m), the constant first
  std::vector<Quad> scales_;
  InvariantValues<T> phi_;
  std::vector<T> value_, slope_;
};

std::vector<double> random_start(const std::vector<Orbit>& orbits, int points, std::mt19937_64& random) {
  const auto uniform = [&random] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::vector<double> x;
  for (const Orbit& orbit : orbits) {
    x.push_back((0.5 + uniform()) / points);
    if (orbit.coordinates == 1) x.push_back(0.5 * uniform());
    if (orbit.coordinates == 2) {
      double a = uniform(), b = uniform();
      if (a + b > 1) a = 1 - a, b = 1 - b;
      x.insert(x.end(), {a, b});
    }
    if (orbit.is_pair) x.push_back(uniform());
  }
  return x;
}

/// All points, orbit by orbit; false unless weights are positive and points inside.
bool expand(const std::vector<Orbit>& orbits, const std::vector<Quad>& x, double min_margin,
            DerivedPrismRule& rule) {
  rule.points.clear();
  Quad margin = 1;
  bool positive = true;
  int at = 0;
  for (const Orbit& orbit : orbits) {
    const Quad weight = x[at];
    const Quad a = orbit.coordinates == 0 ? Quad(1) / 3 : x[at + 1];
    const Quad b = orbit.coordinates == 2 ? x[at + 2] : a;
    const Quad c = 1 - a - b, z = orbit.is_pair ? x[at + 1 + orbit.coordinates] : Quad(0);
    positive = positive && weight > 0;
    margin = std::min({margin, a, b, c, (1 - magnitude(z)) / 2});
    std::vector<std::array<Quad, 2>> triangle;
    if (orbit.coordinates == 0) triangle = {{a, b}};
    if (orbit.coordinates == 1) triangle = {{a, a}, {c, a}, {a, c}};
    if (orbit.coordinates == 2) triangle = {{a, b}, {b, a}, {b, c}, {c, b}, {c, a}, {a, c}};
    for (const auto& [u, v] : triangle) {
      rule.points.push_back({u, v, orbit.is_pair ? -magnitude(z) : z, weight});
      if (orbit.is_pair) rule.points.push_back({u, v, magnitude(z), weight});
    }
    at += orbit.unknowns();
  }
  rule.margin = static_cast<double>(margin);
  return positive && rule.margin > min_margin;
}

/// Orbits that have merged make a rule of fewer points in disguise.
bool has_coincident_points(const DerivedPrismRule& rule) {
  const Quad close(1e-8);
  for (std::size_t i = 0; i < rule.points.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const DerivedPrismPoint &p = rule.points[i], &q = rule.points[j];
      if (magnitude(p.u - q.u) < close && magnitude(p.v - q.v) < close && magnitude(p.w - q.w) < close)
        return true;
    }
  return false;
}

}  // namespace

std::string PrismStructure::name() const {
  std::string text;
  const auto add = [&text](const char* kind, int count) {
    if (count > 0) text += kind + std::to_string(count);
  };
  add("C", centroid_mid);
  add("Cz", centroid_pair);
  add("M", median_mid);
  add("Mz", median_pair);
  add("G", general_mid);
  add("Gz", general_pair);
  return text;
}

std::string DerivedPrismRule::name() const {
  return "prism" + std::to_string(degree) + "-" + std::to_string(points.size());
}

std::vector<PrismStructure> known_prism_structures(int degree) {
  switch (degree) {
    case 4:
      return {{0, 1, 1, 1, 0, 0}};  // 11
    case 5:
      return {{1, 0, 1, 2, 0, 0}};  // 16
    case 6:
      return {{0, 2, 2, 1, 0, 1}};  // 28
    case 8:
      return {{0, 2, 2, 4, 0, 1}};  // 46
    case 10:
      return {{0, 2, 2, 6, 0, 3}, {0, 2, 3, 5, 1, 3}};  // 82, 85
    default:
      return {};
  }
}

DerivedPrismRule search_prism_rule(int degree, const PrismStructure& structure,
                                   const SearchOptions& options) {
  const InvariantBasis basis(degree);
  const std::vector<Orbit> orbits = orbits_of(structure);
  PrismMoments<double> system(basis, degree, orbits);
  PrismMoments<Quad> fine_system(basis, degree, orbits);
  std::mt19937_64 random(options.seed);
  DerivedPrismRule best;
  int converged = 0, solved = 0, start = 0;
  for (; start < options.starts && converged < options.keep; ++start) {
    std::vector<double> x = random_start(orbits, structure.points(), random);
    if (!levenberg_marquardt(system, x, options.max_iterations)) continue;
    ++solved;
    DerivedPrismRule rule;
    std::vector<Quad> fine(x.begin(), x.end());
    if (!expand(orbits, fine, options.min_margin, rule)) continue;
    if (!polish(fine_system, fine, rule.residual)) continue;
    if (!expand(orbits, fine, options.min_margin, rule) || has_coincident_points(rule)) continue;
    ++converged;
    if (best.points.empty() || rule.margin > best.margin) best = rule;
  }
  best.degree = degree;
  best.structure = structure;
  best.converged = converged;
  best.solved = solved;
  best.tried = start;
  return best;
}

std::optional<DerivedPrismRule> derive_prism_rule(int degree, const SearchOptions& options) {
  for (const PrismStructure& structure : known_prism_structures(degree)) {
    DerivedPrismRule rule = search_prism_rule(degree, structure, options);
    if (!rule.points.empty()) return rule;
  }
  return std::nullopt;
}

}  // namespace rhytid::rules
