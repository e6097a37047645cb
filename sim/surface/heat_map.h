// Ligament heat map: b = b̂_t / φ_t, both diffused for time t from compactly supported sources.
//
// Linear in the source strengths: b = Σ_s w_s b_s with w_s = G_s / Σ_r G_r and G_s the diffused kernel of
// source s, (M + t L) G_s = M θ_s. M lumped mass, L cotangent stiffness made an M-matrix (heat_operator.h),
// on the P1 refinement through all in-plane nodes: so b stays between the smallest and largest strength. One
// factorisation, one back-solve per source.
//
//   ∂G_s/∂t solves (M + t L) Ġ_s = −L G_s,   ∂w_s/∂t = (Ġ_s − w_s Σ_r Ġ_r) / Σ_r G_r
//
// Source   the publication, "Ligament Heat Map"; the publication solves on the quartic elements, which leave
//          the hull.
// Limits   t = 0: the kernels themselves; t → ∞: w_s = m_s / Σ_r m_r with m_s = Σ M θ_s, on every connected part.
// Units    t mm², radius mm, b 1/mm.
// Tests    tests/sim/surface/heat_map_test.cpp
#pragma once

#include <array>
#include <vector>

#include "sim/core/types.h"

namespace rhytid {

struct HeatSource {
  Vec3 position;  ///< mm, on the surface (already projected)
  double radius;  ///< mm, support of the kernel (1−(d/h)²)⁴, d straight through space
};

struct HeatMapWeights {
  MatrixXd weights;           ///< [num_nodes][num_sources], rows sum to 1, entries ≥ 0
  MatrixXd d_weights_d_time;  ///< ∂weights/∂t, 1/mm²
  /// Nodes that no source reaches (φ underflows, or another connected part): they take the nearest source.
  int num_unreached = 0;
  /// Sources whose kernel contains no node (radius below the node spacing): they act on the nearest node
  /// alone.
  std::vector<int> unresolved_sources;
};

/// Diffuses every source for time t (one implicit step) and normalises. A node that no source reaches
/// (φ underflows) takes the nearest source's strength (d/dt = 0 there). Throws ContractError when there is no
/// source, t < 0, a radius is not positive, something is not finite, or the triangles are unusable
/// (assemble_heat_operator).
HeatMapWeights diffuse_sources(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                               const std::vector<HeatSource>& sources, double time);

/// How the map moves with a source: D_r / φ, [num_nodes][3], 1/mm, where D_r solves (M + t L) D_r = M ∂θ_r/∂p
/// for the position p of source r. Then ∂w_s/∂p = (δ_sr − w_s) D_r/φ, and of b = Σ_s w_s b_s
///   ∂b/∂p = (b_r − b) D_r/φ.
/// Zero at nodes that no source reaches, and everywhere for an unresolved source (the map then jumps from
/// node to node). Throws as diffuse_sources does.
MatrixXd source_motion(const MatrixX3& nodes, const std::vector<std::array<int, 3>>& triangles,
                       const std::vector<HeatSource>& sources, double time, int source);

/// Calls of diffuse_sources since the program began: work that only ligament sources cause.
long heat_maps_solved();

}  // namespace rhytid
