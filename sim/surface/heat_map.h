// Ligament heat map: b = b̂_t / φ_t, both diffused for time t from compactly supported sources.
//
// Linear in the source strengths: b = Σ_s w_s b_s with w_s = G_s / Σ_r G_r and G_s the diffused kernel of source
// s, (M + t L) G_s = M θ_s. M lumped mass, L cotangent stiffness made an M-matrix (intrinsic Delaunay, or clamped
// weights), on the P1 refinement through all in-plane nodes: so b stays between the smallest and largest strength.
//
// Source   paper.tex "Ligament Heat Map"; DESIGN section 2 "Heat map".
// Units    t mm², radius mm, b 1/mm.
#pragma once

#include <array>
#include <vector>

#include "sim/core/types.h"

namespace rhytid {

struct HeatSource {
  Vec3 position;  ///< mm, on the surface (already projected)
  double radius;  ///< mm, support of the kernel (1−(d/h)²)⁴
};

struct HeatMapWeights {
  MatrixXd weights;           ///< [num_nodes][num_sources], rows sum to 1, entries ≥ 0
  MatrixXd d_weights_d_time;  ///< ∂weights/∂t, 1/mm²
};

/// Diffuses every source for time t (one implicit step) and normalises. A node that no source reaches
/// (φ underflows) takes the nearest source's strength (d/dt = 0 there). Throws ContractError when there is no
/// source or t < 0.
HeatMapWeights diffuse_sources(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                               const std::vector<HeatSource>& sources, double time);

}  // namespace rhytid
