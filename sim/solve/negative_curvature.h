// A direction in which an indefinite Hessian curves downwards. Internal to sim/solve.
#pragma once

#include <optional>

#include "sim/core/types.h"
#include "sim/solve/block_matrix.h"

namespace rhytid {

struct NegativeCurvature {
  VectorXd direction;    ///< v with vᵀ P v = 1
  double curvature = 0;  ///< vᵀ H v < 0
};

/// Lanczos for the lowest eigenvalue of H v = θ P v, in the inner product of P: `raw` is H, `projected` the
/// factor of P. Where the projection changed nothing P⁻¹H has eigenvalue 1, so the negative ones stand apart
/// and few steps find them. `start` must be (P − H) r for some random r: it vanishes on fixed unknowns, and
/// so does everything built from it. Empty when no curvature below −1e-10 shows up.
std::optional<NegativeCurvature> find_negative_curvature(const BlockMatrix& raw,
                                                         const CholeskyFactor& projected,
                                                         const VectorXd& start, int max_steps = 40);

}  // namespace rhytid
