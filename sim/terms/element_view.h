// What an element kernel is given, as plain numbers and pointers.
#pragma once

#include <algorithm>
#include <cstddef>

namespace rhytid {

/// Nodes of an element at most.
inline constexpr int kMaxElementNodes = 80;
/// Directions that one tangent kernel call carries.
inline constexpr int kDirections = 8;
/// Rows of the table that one Hessian pass treats; a multiple of R.
inline constexpr int kHessianRows = 24;

/// Points through the thickness at most, and length of a row of their table.
inline constexpr int kMaxLinePoints = 6, kLineStride = 8;

/// Where a prism's shape functions and points are products of plane and line, both factors by themselves: node
/// (j, c) is j · line_nodes + c, point (t, z) is t · line_points + z.
struct ProductView {
  int plane_nodes = 0, padded_plane_nodes = 0;  ///< padded to a multiple of 8
  int line_nodes = 0, line_points = 0;          ///< 0 points: no product
  const double* plane = nullptr;                ///< [t][∂/∂u, ∂/∂v, value][padded_plane_nodes]
  const double* line = nullptr;                 ///< [z][value, ∂/∂w][kLineStride]
  const double* plane_by_node =
      nullptr;                ///< `plane` the other way round: [node][∂/∂u, ∂/∂v, value by t], padded
  int padded_plane_rows = 0;  ///< length of a row of it, a multiple of 8

  static constexpr int kMaxLineNodes = 5;  ///< at most
  static constexpr int kPlaneSlots = 32;   ///< plane points that one Hessian pass treats
  /// Pairs of (line node, component), each once, padded to a multiple of 8.
  int pairs() const { return (3 * line_nodes * (3 * line_nodes + 1) / 2 + 7) / 8 * 8; }
};

/// Doubles that the sum of an element's Hessian needs (HessianBlocks, ProductHessian).
inline std::size_t hessian_work_size(int padded_nodes, const ProductView& p) {
  const std::size_t n8 = static_cast<std::size_t>(padded_nodes), rows = kHessianRows,
                    np = static_cast<std::size_t>(p.plane_nodes), pairs = static_cast<std::size_t>(p.pairs()),
                    slots = ProductView::kPlaneSlots;
  // The matrix, left factors of a tile, factors of the plane points; what these may write too far; a cache line.
  const std::size_t product = np * np * pairs + 3 * slots * 5 * 8 + 9 * slots * pairs + 8 + 8;
  return std::max(6 * n8 * n8 + 7 * rows * n8, product);
}

/// Everything an element kernel reads, as plain pointers (null where a law has none).
struct ElementView {
  int num_nodes, padded_nodes;     ///< n, npad (multiple of 8)
  int num_points;                  ///< nq
  int padded_rows;                 ///< length of a row of `rows_by_node`, ≥ nq·R, multiple of 8
  const double* node_by_row;       ///< [nq·R][npad]
  const double* rows_by_node;      ///< [n][padded_rows], the transpose
  const double* inverse_jacobian;  ///< prisms: [nq][3][3] ∂ξ_r/∂X_I; surfaces: null
  const double* weight;            ///< [nq] integration weight, mm³ or mm²
  const double* rest;              ///< [nq][nrest]
  const double* theta;             ///< [nq][ntheta], or one row when theta_stride = 0
  int theta_stride;
  double dt;                 ///< s
  ProductView product = {};  ///< prisms with a product rule
};

}  // namespace rhytid
