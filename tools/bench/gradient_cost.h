// What derivatives of a run cost beside the run itself, all measured in one process, turn by turn.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "sim/scene/scene_model.h"

namespace rhytid::tools {

/// Columns of ∂native/∂x, x as in adjoint/parameter_space.h, for the first `count` parameters of the scene that
/// have an effect on the native vector.
MatrixXd parameter_columns(const SceneModel& scene_model, int count);

struct GradientCostOptions {
  int repeats = 3;      ///< of every part, in turn; medians are reported
  int parameters = 16;  ///< columns of the Jacobian
  int points = 200;     ///< outer points that the functional looks at
};

/// Medians over the repeats, s unless said otherwise.
struct GradientCost {
  int nodes = 0, unknowns = 0, points = 0;            ///< points: quadrature points of all terms
  int steps = 0, iterations = 0, factorisations = 0;  ///< of the run with the scene's own tolerance
  int tight_iterations = 0;                           ///< of the run that is differentiated (tight, polished)
  double forward = 0;                                 ///< the scene's own tolerance
  double forward_tight = 0;
  double adjoint = 0;   ///< one functional, all native parameters
  double jacobian = 0;  ///< tangent sweep with `columns` parameters
  int columns = 0;
  double duality = 0;  ///< |<J v, w> − <v, Jᵀ w>| relative: what was timed is right
};

/// Told before each part, and with no name within; false stops.
using CostProgress = std::function<bool(const std::string& part)>;

/// Runs the scene and differentiates it by its first parameters that have an effect; nothing when it was
/// stopped. Throws adjoint::GradientError when the run does not reach its last frame or cannot be
/// differentiated.
std::optional<GradientCost> measure_gradient_cost(const SceneModel& scene_model,
                                                  const GradientCostOptions& options,
                                                  const CostProgress& progress = {});

}  // namespace rhytid::tools
