// What an element kernel is given, as plain numbers and pointers.
#pragma once

namespace rhytid {

/// Directions that one tangent kernel call carries.
inline constexpr int kDirections = 8;
/// Rows of the table that one Hessian pass treats; a multiple of R.
inline constexpr int kHessianRows = 24;

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
  double dt;  ///< s
};

}  // namespace rhytid
