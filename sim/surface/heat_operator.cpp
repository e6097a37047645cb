#include "sim/surface/heat_operator.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "sim/core/error.h"

namespace rhytid {
namespace {

constexpr int kNone = -1;

/// Area from edge lengths, Kahan's form (sorted, the brackets matter); 0 when the triangle inequality fails.
double triangle_area(double a, double b, double c) {
  if (a < b) std::swap(a, b);
  if (a < c) std::swap(a, c);
  if (b < c) std::swap(b, c);
  const double q = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
  return q > 0 ? 0.25 * std::sqrt(q) : 0;
}

/// Triangles that know only their edge lengths and neighbours. Half-edge 3 t + k runs from corner k of
/// triangle t to corner k + 1.
class IntrinsicMesh {
 public:
  IntrinsicMesh(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles) {
    const std::size_t n = 3 * triangles.size();
    origin_.resize(n);
    length_.resize(n);
    twin_.assign(n, kNone);
    for (std::size_t t = 0; t < triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k) origin_[3 * t + k] = triangles[t][k];
    for (std::size_t h = 0; h < n; ++h)
      length_[h] = (nodes.row(origin_[next(h)]) - nodes.row(origin_[h])).norm();
    open_degenerate_triangles();
    find_twins();
  }

  std::size_t num_half_edges() const { return origin_.size(); }
  int origin(std::size_t h) const { return origin_[h]; }
  int target(std::size_t h) const { return origin_[next(h)]; }
  double area(std::size_t t) const {
    return triangle_area(length_[3 * t], length_[3 * t + 1], length_[3 * t + 2]);
  }
  /// Cotangent of the angle opposite to half-edge h.
  double cotangent(std::size_t h) const {
    const double c = length_[h], a = length_[next(h)], b = length_[previous(h)];
    // a² + b² − c², the difference of squares first: no cancellation where a or b is short.
    return (a >= b ? (a - c) * (a + c) + b * b : (b - c) * (b + c) + a * a) / (4 * area(h / 3));
  }

  /// Flips until every interior edge has w ≥ 0. Returns the number of flips.
  int make_delaunay() {
    // Ties (a square cut by a diagonal: w = 0 up to rounding) stay as they are, so that the result does not
    // depend on how the mesh is placed in space.
    constexpr double kTie = -1e-9;
    std::vector<std::size_t> queue;
    for (std::size_t h = num_half_edges(); h-- > 0;) queue.push_back(h);
    // Flipping terminates in exact arithmetic; the bound guards against rounding. What is left is clamped.
    const std::size_t max_flips = 100 * num_half_edges();
    std::size_t flips = 0;
    while (!queue.empty() && flips < max_flips) {
      const std::size_t h = queue.back();
      queue.pop_back();
      if (twin_[h] == kNone) continue;
      const auto g = static_cast<std::size_t>(twin_[h]);
      if (h / 3 == g / 3 || cotangent(h) + cotangent(g) >= kTie) continue;
      if (!flip(h, g)) continue;
      ++flips;
      for (const std::size_t edge : {3 * (h / 3), 3 * (h / 3) + 2, 3 * (g / 3), 3 * (g / 3) + 1})
        queue.push_back(edge);
    }
    return static_cast<int>(flips);
  }

 private:
  std::vector<int> origin_;
  std::vector<double> length_;
  std::vector<int> twin_;

  static std::size_t next(std::size_t h) { return h % 3 == 2 ? h - 2 : h + 1; }
  static std::size_t previous(std::size_t h) { return h % 3 == 0 ? h + 2 : h - 1; }

  /// Adds the smallest common length that gives every triangle a slack of 1e-8 mean edges in the triangle
  /// inequality (a height of about 1e-4 edges): large enough for finite cotangents, too small to see.
  void open_degenerate_triangles() {
    double mean = 0;
    for (const double length : length_) mean += length / static_cast<double>(length_.size());
    require(mean > 0 && std::isfinite(mean), "assemble_heat_operator: nodes coincide or are not finite");
    double missing = 0;
    for (std::size_t h = 0; h < length_.size(); ++h)
      missing = std::max(missing, 1e-8 * mean - (length_[next(h)] + length_[previous(h)] - length_[h]));
    for (double& length : length_) length += missing;
  }

  void find_twins() {
    std::vector<std::tuple<int, int, std::size_t>> sorted;
    for (std::size_t h = 0; h < num_half_edges(); ++h) {
      const auto [lo, hi] = std::minmax({origin(h), target(h)});
      sorted.emplace_back(lo, hi, h);
    }
    std::sort(sorted.begin(), sorted.end());
    const auto same_edge = [&](std::size_t a, std::size_t b) {
      return std::get<0>(sorted[a]) == std::get<0>(sorted[b]) &&
             std::get<1>(sorted[a]) == std::get<1>(sorted[b]);
    };
    for (std::size_t begin = 0, end = 0; begin < sorted.size(); begin = end) {
      for (end = begin + 1; end < sorted.size() && same_edge(begin, end);) ++end;
      if (end != begin + 2) continue;
      const std::size_t h = std::get<2>(sorted[begin]), g = std::get<2>(sorted[begin + 1]);
      if (origin(h) == origin(g)) continue;  // opposite orientations: cannot be unfolded as written
      twin_[h] = static_cast<int>(g);
      twin_[g] = static_cast<int>(h);
    }
  }

  /// Half-edges h = (i, j) of triangle (i, j, k) and g = (j, i) of (j, i, l) become (i, l, k) and (l, j, k).
  /// Refuses (returns false) when rounding would make a new triangle flat.
  bool flip(std::size_t h, std::size_t g) {
    const std::size_t jk = next(h), ki = previous(h), il = next(g), lj = previous(g);
    // Unfold: i at 0, j at (c, 0), k above, l below.
    const double c = length_[h];
    const auto along = [c](double from_i, double from_j) {
      return 0.5 * (c + (from_i - from_j) * (from_i + from_j) / c);
    };
    const double height = 2 * (area(h / 3) + area(g / 3)) / c;
    const double diagonal =
        std::hypot(along(length_[ki], length_[jk]) - along(length_[il], length_[lj]), height);
    if (!(triangle_area(length_[il], diagonal, length_[ki]) > 0) ||
        !(triangle_area(length_[lj], length_[jk], diagonal) > 0))
      return false;
    const std::size_t t0 = 3 * (h / 3), t1 = 3 * (g / 3);
    const int k = origin_[ki], j = origin_[jk], i = origin_[il], l = origin_[lj];
    const std::array<std::size_t, 4> old_slot{il, ki, lj, jk};
    const std::array<std::size_t, 4> new_slot{t0, t0 + 2, t1, t1 + 1};
    std::array<double, 4> length{};
    std::array<int, 4> twin{};
    for (std::size_t m = 0; m < 4; ++m) {
      length[m] = length_[old_slot[m]];
      twin[m] = twin_[old_slot[m]];
      // The neighbour across may be one of the moved half-edges itself.
      for (std::size_t q = 0; q < 4; ++q)
        if (twin_[old_slot[m]] == static_cast<int>(old_slot[q])) twin[m] = static_cast<int>(new_slot[q]);
    }
    for (std::size_t m = 0; m < 4; ++m) {
      length_[new_slot[m]] = length[m];
      twin_[new_slot[m]] = twin[m];
      if (twin[m] != kNone) twin_[static_cast<std::size_t>(twin[m])] = static_cast<int>(new_slot[m]);
    }
    origin_[t0] = i, origin_[t0 + 1] = l, origin_[t0 + 2] = k;
    origin_[t1] = l, origin_[t1 + 1] = j, origin_[t1 + 2] = k;
    length_[t0 + 1] = length_[t1 + 2] = diagonal;
    twin_[t0 + 1] = static_cast<int>(t1 + 2);
    twin_[t1 + 2] = static_cast<int>(t0 + 1);
    return true;
  }
};

}  // namespace

HeatOperator assemble_heat_operator(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles) {
  require(!triangles.empty(), "assemble_heat_operator: no triangles");
  for (const auto& [a, b, c] : triangles) {
    require(std::min({a, b, c}) >= 0 && std::max({a, b, c}) < nodes.rows(),
            "assemble_heat_operator: triangle index out of range");
    require(a != b && b != c && c != a, "assemble_heat_operator: a triangle repeats a node");
  }
  IntrinsicMesh mesh(nodes, triangles);
  HeatOperator result;
  result.num_flips = mesh.make_delaunay();
  result.mass = VectorXd::Zero(nodes.rows());
  std::vector<WeightedEdge> sides;
  for (std::size_t h = 0; h < mesh.num_half_edges(); ++h) {
    result.mass[mesh.origin(h)] += mesh.area(h / 3) / 3;
    const auto [lo, hi] = std::minmax({mesh.origin(h), mesh.target(h)});
    if (lo != hi) sides.push_back({lo, hi, 0.5 * mesh.cotangent(h)});
  }
  std::stable_sort(sides.begin(), sides.end(), [](const WeightedEdge& a, const WeightedEdge& b) {
    return std::tie(a.i, a.j) < std::tie(b.i, b.j);
  });
  for (std::size_t begin = 0, end = 0; begin < sides.size(); begin = end) {
    double weight = 0;
    for (end = begin; end < sides.size() && sides[end].i == sides[begin].i && sides[end].j == sides[begin].j;
         ++end)
      weight += sides[end].weight;
    if (weight > 0) result.edges.push_back({sides[begin].i, sides[begin].j, weight});
    // A right angle's rounded cotangent is not worth reporting.
    if (weight < -1e-9) ++result.num_clamped;
  }
  return result;
}

}  // namespace rhytid
