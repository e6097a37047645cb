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

/// One measured Newton iteration at rest, colliders at time 0, and what follows for the run.
struct StepCost {
  double residual_seconds = 0, hessian_seconds = 0, factor_seconds = 0, solve_seconds = 0;
  double analysis_seconds = 0;                   ///< symbolic analysis, once per run
  std::size_t factor_entries = 0;                ///< nnz(L) stored
  bool positive_definite = false;                ///< of the raw Hessian at rest
  double smallest_pivot = 0, largest_pivot = 0;  ///< diagonal of L², N/mm; 0 unless positive definite
  double rest_residual = 0;  ///< |∂W/∂q|₂ at u = 0, N: exactly 0 for a rest equilibrium
  double iteration_seconds() const {
    // A line search takes about one and a half evaluations per accepted step.
    return 1.5 * residual_seconds + hessian_seconds + factor_seconds + solve_seconds;
  }
};
/// Measures on the calling machine with the threads in force. One energy + gradient, one Hessian, one
/// factorisation, one solve.
StepCost measure_step_cost(const SceneModel& scene_model);

/// Newton iterations per step that an estimate assumes (8 to 14 were seen on skin with contact).
inline constexpr int expected_iterations = 10;

/// Memory of a run, MB: arrays of the model, matrix and factor, states.
struct MemoryEstimate {
  double model = 0, matrix = 0, factor = 0, states = 0;
  double total() const { return model + matrix + factor + states; }
};
MemoryEstimate memory_estimate(const SceneModel& scene_model, const ModelSize& size,
                               std::size_t factor_entries);

}  // namespace rhytid::tools
