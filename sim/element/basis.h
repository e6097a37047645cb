// Lagrange bases of the solid-shell prism: order p on the triangle times order q through the thickness.
//
//   N_(j,k)(u,v,w) = P_j(u,v) T_k(w),   u, v ≥ 0, u + v ≤ 1,   w ∈ [−1, 1]
//
// Source   the publication, "Displacement Interpolation"; orders p, q = 1..4, equispaced nodes.
#pragma once

#include <array>
#include <vector>

namespace rhytid {

/// Lagrange basis of order p on the reference triangle, equispaced nodes.
/// Node order: 3 corners (0,0), (1,0), (0,1); then edges 0→1, 1→2, 2→0 (p−1 interior nodes each, in the
/// direction of the edge); then interior nodes, rows of constant v with u rising (for j, for i).
class TriangleBasis {
 public:
  /// Throws ContractError unless 1 ≤ order ≤ 4.
  explicit TriangleBasis(int order);
  int order() const { return order_; }
  int num_nodes() const { return static_cast<int>(nodes_.size()); }  ///< (p+1)(p+2)/2
  /// Natural coordinates (u, v) of the nodes.
  const std::vector<std::array<double, 2>>& nodes() const { return nodes_; }
  /// Integer lattice coordinates (i, j) of the nodes: u = i/p, v = j/p.
  const std::vector<std::array<int, 2>>& lattice() const { return lattice_; }
  /// The p² sub-triangles of the P1 refinement through the nodes, counter-clockwise, as local node indices.
  const std::vector<std::array<int, 3>>& subtriangles() const { return subtriangles_; }
  /// Values and derivatives by u and v at one point; each output has num_nodes() entries, null = not wanted.
  void evaluate(double u, double v, double* values, double* d_du, double* d_dv) const;

 private:
  int order_;
  std::vector<std::array<double, 2>> nodes_;
  std::vector<std::array<int, 2>> lattice_;
  std::vector<std::array<int, 3>> subtriangles_;
};

/// Lagrange basis of order q on [−1, 1], equispaced nodes from −1 (inner) to 1 (outer).
class LineBasis {
 public:
  /// Throws ContractError unless 1 ≤ order ≤ 4.
  explicit LineBasis(int order);
  int order() const { return order_; }
  int num_nodes() const { return order_ + 1; }
  const std::vector<double>& nodes() const { return nodes_; }
  /// Values and derivative by w at one point; each output has num_nodes() entries, null = not wanted.
  void evaluate(double w, double* values, double* d_dw) const;

 private:
  int order_;
  std::vector<double> nodes_;
};

}  // namespace rhytid
