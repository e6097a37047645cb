// Search for fully symmetric quadrature rules on the prism: positive weights, points strictly inside.
//
// The symmetry group is D3 × Z2: the permutations of the corners, and the mirror w → −w. An orbit of the
// triangle (centroid, median, general) lies on the mid-plane w = 0 or comes as a pair at w = ±z. Only
// polynomials φₖ(s, t) L₂ₘ(w) need to be matched, φₖ the orthonormal invariants of the triangle and L₂ₘ the
// even orthonormal Legendre polynomials, of total degree deg φₖ + 2m up to the rule's.
//
// The orbit structures tried are given (known ones from the literature, or the user's); the coordinates and
// weights are derived: Levenberg-Marquardt in double precision from seeded random starts, then minimum-norm
// Newton steps in quadruple precision.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/rules/triangle_rule_search.h"

namespace rhytid::rules {

/// Number of orbits of each kind; `mid` lie at w = 0, `pair` at w = ±z.
struct PrismStructure {
  int centroid_mid = 0, centroid_pair = 0, median_mid = 0, median_pair = 0, general_mid = 0, general_pair = 0;
  int points() const {
    return centroid_mid + 2 * centroid_pair + 3 * median_mid + 6 * median_pair + 6 * general_mid +
           12 * general_pair;
  }
  int unknowns() const {
    return centroid_mid + 2 * centroid_pair + 2 * median_mid + 3 * median_pair + 3 * general_mid +
           4 * general_pair;
  }
  std::string name() const;  ///< e.g. "Cz2M2Mz1Gz1"
};

/// The structures tried for a total degree, by rising number of points. Empty for a degree without one.
std::vector<PrismStructure> known_prism_structures(int degree);

struct DerivedPrismPoint {
  Quad u, v, w, weight;  ///< u, v, 1 − u − v > 0, −1 < w < 1; weights sum to the volume 1
};

struct DerivedPrismRule {
  int degree = 0;
  PrismStructure structure;
  std::vector<DerivedPrismPoint> points;  ///< orbit by orbit
  double residual = 0;                    ///< largest orthonormal moment error after polishing
  double margin = 0;                      ///< smallest of all barycentric coordinates and (1 − |w|)/2
  int converged = 0;                      ///< starts that ended in a valid rule
  int solved = 0;  ///< starts that solved the moment equations, points outside and negative weights included
  int tried = 0;
  std::string name() const;  ///< "prism<degree>-<points>"
};

/// The widest of the first `options.keep` valid rules of this structure; `points` is empty when there is
/// none. Deterministic for a given seed.
DerivedPrismRule search_prism_rule(int degree, const PrismStructure& structure, const SearchOptions& options);

/// The first structure of `known_prism_structures` that yields a rule.
std::optional<DerivedPrismRule> derive_prism_rule(int degree, const SearchOptions& options);

}  // namespace rhytid::rules
