// Quadrature on the reference triangle and line. Triangle rules are fully symmetric with positive interior
// weights, derived by tools/derive_rules and stored in data/quadrature (compiled in from a generated table);
// Gauss-Legendre rules are computed.
#pragma once

#include <string>
#include <vector>

namespace rhytid {

struct TrianglePoint {
  double u, v;    ///< natural coordinates, strictly inside u, v > 0, u + v < 1
  double weight;  ///< weights of a rule sum to the area 1/2
};

/// A rule that integrates all polynomials of total degree ≤ `degree` on the reference triangle.
struct TriangleRule {
  std::string name;  ///< e.g. "tri10-25": stored with every checkpoint, since C^v lives at these points
  int degree;
  std::vector<TrianglePoint> points;
};

/// The stored rule of lowest degree ≥ `degree`. Degrees 1..12 exist; throws ContractError beyond.
const TriangleRule& triangle_rule(int degree);

struct LinePoint {
  double w;       ///< in (−1, 1)
  double weight;  ///< weights sum to 2
};

/// Gauss-Legendre rule with n points, exact to degree 2n−1. Throws ContractError unless 1 ≤ n ≤ 16.
std::vector<LinePoint> gauss_legendre(int num_points);

}  // namespace rhytid
