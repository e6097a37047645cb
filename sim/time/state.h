// Everything that crosses a step. What is not in here, the adjoint cannot see.
#pragma once

#include "sim/core/types.h"

namespace rhytid {

/// State after a converged step: displacement and per-point histories (C^v − I of skin, the lag of friction
/// and, extrapolated, its rates), the slices of the terms one after the other in the model's order.
struct State {
  double time = 0;   ///< s
  VectorXd u;        ///< [num_nodes·3] displacement, mm
  VectorXd history;  ///< [history_size]
  /// [num_nodes·3] mean velocity of the step that led here, mm/s; empty at rest. Only the next step's first
  /// guess reads it, no equation does, so the adjoint need not see it.
  VectorXd velocity;
};

}  // namespace rhytid
