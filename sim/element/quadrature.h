// Quadrature on the reference triangle, line and prism. Triangle and prism rules are fully symmetric with
// positive interior weights, derived by tools/derive_rules and stored in data/quadrature (compiled in from
// generated tables); Gauss-Legendre rules are computed.
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
  std::string name;  ///< e.g. "tri10-25"
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

struct PrismPoint {
  double u, v;    ///< as in TrianglePoint
  double w;       ///< through the thickness, in (−1, 1)
  double weight;  ///< weights of a rule sum to the volume 1
};

/// A rule on the reference prism, where C^v lives; `degree` is the total degree in (u, v, w) it integrates.
struct PrismRule {
  std::string name;  ///< e.g. "prism6-28" or "tri10-25 x GL3"
  int degree;
  std::vector<PrismPoint> points;
  int line_points = 0;  ///< points through the thickness when the rule is a product (tensor_rule), else 0
};

/// The stored prism rule of lowest degree ≥ `degree`: 1 (centroid × 2 Gauss points), 4, 5, 6, 8; the rules
/// that the publication uses for its sheets. Throws ContractError outside 1..8.
const PrismRule& prism_rule(int degree);

/// Product of a triangle rule and a Gauss-Legendre rule: exact to the triangle's degree in the plane and to
/// 2·num_points − 1 through the thickness. Thickness index fastest.
PrismRule tensor_rule(const TriangleRule& triangle, int num_points);

}  // namespace rhytid
