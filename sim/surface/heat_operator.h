// Lumped mass and cotangent stiffness of a triangle mesh in space, as an M-matrix for any mesh.
//
//   (L u)_i = Σ_j w_ij (u_i − u_j),  w_ij = ½ (cot α + cot β) ≥ 0,   M_i = ⅓ Σ area
//
// Edges are flipped to the intrinsic Delaunay triangulation (only edge lengths change, the surface does not),
// so interior weights are ≥ 0 and the operator stays a consistent P1 Laplacian on obtuse and stretched
// triangles. What flipping cannot cure is clamped at zero: a boundary edge opposite an obtuse angle, an edge
// shared by more than two triangles or by two of opposite orientation. Degenerate triangles are opened by
// adding one tiny length to every edge, so all cotangents are finite.
//
// Source  M. Fisher, B. Springborn, P. Schröder, A. Bobenko 2007 (intrinsic Delaunay flips); N. Sharp, K.
// Crane
//         2020 (adding a length to all edges).
#pragma once

#include <array>
#include <vector>

#include "sim/core/types.h"
#include "sim/surface/m_matrix_factor.h"

namespace rhytid {

struct HeatOperator {
  VectorXd mass;                    ///< M_i, mm²; 0 for a node of no triangle
  std::vector<WeightedEdge> edges;  ///< w_ij > 0, i < j, each pair once, sorted
  int num_flips = 0;                ///< edges flipped
  int num_clamped = 0;              ///< pairs whose weight was negative and is left out
};

/// nodes [n][3] mm. Throws ContractError when there is no triangle, an index is out of range or repeated
/// within a triangle, or all nodes coincide.
HeatOperator assemble_heat_operator(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles);

}  // namespace rhytid
