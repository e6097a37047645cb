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

/// Newton iterations per step that an estimate assumes: 4 to 8 were seen on the bundled scenes; where a finger drags
/// over a film that wrinkles they are twice as many.
inline constexpr int expected_iterations = 6;

/// The parts of a measured Newton iteration at rest, colliders at time 0, and what follows for the run.
struct StepCost {
  double residual_seconds = 0, hessian_seconds = 0;
  double factor_seconds = 0,
         solve_seconds = 0;        ///< of an iteration: in single precision where the solver takes that
  double certificate_seconds = 0;  ///< factor in double precision at the end of a step
  double state_seconds = 0;        ///< preparing a step and the state after it
  double analysis_seconds = 0;     ///< symbolic analysis, once per run
  std::size_t factor_entries = 0;  ///< nnz(L) stored
  bool positive_definite = false;  ///< of the raw Hessian at rest
  double smallest_pivot = 0, largest_pivot = 0;  ///< diagonal of L², N/mm; 0 unless positive definite
  double rest_residual =
      0;  ///< |∂W/∂q|₂ where the first step starts, N: exactly 0 for a rest equilibrium; infinite outside the domain
  double iteration_seconds() const {
    // A line search takes about one and a half evaluations per accepted step.
    return 1.5 * residual_seconds + hessian_seconds + factor_seconds + solve_seconds;
  }
  /// A step ends with the Hessian and its factor at the solution, the certificate of a minimum. Later passes over the
  /// lag (`passes` of them in all) start from the state of the one before.
  double step_seconds(int passes = 1) const {
    return state_seconds +
           passes * (expected_iterations * iteration_seconds() + hessian_seconds + certificate_seconds);
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
