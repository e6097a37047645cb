// How large a scene is and what a step of it costs: for `check`, and for the record of a run.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "sim/scene/scene_model.h"

namespace rhytid::tools {

struct TermSize {
  std::string name;
  long points = 0;                      ///< quadrature points
  std::size_t history = 0;              ///< doubles carried from step to step
  std::vector<int> points_per_element;  ///< per group of elements (element layer and material, or surface)
};

/// Counts, all exact.
struct ModelSize {
  int faces = 0, columns = 0, levels = 0, nodes = 0, elements = 0, unknowns = 0;
  std::size_t history = 0;         ///< doubles of State::history
  std::size_t matrix_entries = 0;  ///< stored scalars of the lower triangle of A
  std::vector<TermSize> terms;
};
ModelSize model_size(const SceneModel& scene_model);

/// What an estimate assumes: iterations of each pass of a step, of which 7 to 14 were seen on the bundled scenes, and
/// Hessians with their factors in a step, 3 to 7, whatever its passes (they share them).
inline constexpr int expected_iterations = 12, expected_factors = 5;

/// The parts of a measured Newton iteration at rest, colliders at time 0, and what follows for the run.
struct StepCost {
  double residual_seconds = 0, hessian_seconds = 0;
  double factor_seconds = 0,
         solve_seconds = 0;  ///< in single precision where the solver takes that
  double direction_seconds =
      0;                     ///< of Newton's step: a solve, with its corrections where the factor is single
  double state_seconds = 0;  ///< preparing a step and the state after it
  double analysis_seconds = 0;                   ///< symbolic analysis, once per run
  std::size_t factor_entries = 0;                ///< nnz(L) stored
  bool positive_definite = false;                ///< of the raw Hessian at rest
  double smallest_pivot = 0, largest_pivot = 0;  ///< diagonal of L², N/mm; 0 unless positive definite
  double rest_residual =
      0;  ///< |∂W/∂q|₂ where the first step starts, N: exactly 0 for a rest equilibrium; infinite outside the domain
  /// With the factor kept. A line search takes about one and a third evaluations per accepted step.
  double iteration_seconds() const { return 4. / 3 * residual_seconds + solve_seconds; }
  /// A Hessian with its factor and Newton's direction. The last of a step is mostly its certificate as a minimum.
  double newton_seconds() const { return hessian_seconds + factor_seconds + direction_seconds; }
  /// `passes` over the lag in all.
  double step_seconds(int passes = 1) const {
    return state_seconds + passes * expected_iterations * iteration_seconds() +
           expected_factors * newton_seconds();
  }
};
/// Measures on the calling machine with the threads in force what things take on cores of its own; the quick ones
/// several times.
StepCost measure_step_cost(const SceneModel& scene_model);

/// Memory of a run, MB: arrays of the model, matrix and factor, states, element matrices on their way into the
/// matrix, and the program itself, which is the caller's to fill in.
struct MemoryEstimate {
  double model = 0, matrix = 0, factor = 0, states = 0, elements = 0, program = 0;
  double total() const { return model + matrix + factor + states + elements + program; }
};
MemoryEstimate memory_estimate(const SceneModel& scene_model, const ModelSize& size,
                               std::size_t factor_entries);

}  // namespace rhytid::tools
