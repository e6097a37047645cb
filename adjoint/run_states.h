// The states of a run, whether or not it kept their histories (RunOptions::keep_histories).
//
// A history follows from the displacements, s_i = G(u_i; u_{i−1}, s_{i−1}), pass by pass, with no solve: the
// calls that the run itself made, on the same numbers, so the same bits. It costs two evaluations or so where
// a step of a sweep costs a factorisation.
//
// Tests   tests/adjoint/checkpoints_test.cpp
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "sim/time/simulate.h"
#include "sim/time/step_passes.h"

namespace rhytid::adjoint {

using SharedState = std::shared_ptr<const State>;

/// The state that a run starts from. The run must outlive it.
SharedState first_state(const Trajectory& run);
/// The state after step i, whose passes these are: the run's own (which must then outlive it), or, when its
/// history was dropped, recomputed.
SharedState state_after(const Trajectory& run, int i, StepPasses& passes);

/// What walking a run backwards took.
struct CheckpointReport {
  long slots = 0;               ///< states that could be kept at a time
  long recomputed_steps = 0;    ///< advances; 0 when the run kept its histories
  std::size_t state_bytes = 0;  ///< of one state, displacement and history
  /// Of all states held at one time, at most, those of the caller and of the passes of a step among them; 0
  /// when the run kept them.
  std::size_t held_bytes = 0;
};

/// The states of a run from the last to the first. Where the run dropped its histories, as many states are
/// kept as a budget allows, at binomial distances (checkpoint_schedule.h), and the rest is recomputed.
class ReverseStates {
 public:
  static constexpr std::size_t unlimited = std::numeric_limits<std::size_t>::max();
  /// `budget` in bytes, for all states held at one time. Three of them are in use while a state is recomputed
  /// (the caller's, the one before the step and the one after it), and one more for every earlier pass of a
  /// step. With less than those take, nothing is kept but the start of the run. Model, native and run must
  /// outlive it.
  ReverseStates(const Model& model, const VectorXd& native, const Trajectory& run, std::size_t budget);
  /// The state after `steps` steps; from call to call `steps` must not rise. The caller holds no more than
  /// this one and the one before.
  SharedState after(int steps);
  const CheckpointReport& report() const { return report_; }

 private:
  struct Kept {
    int steps;
    SharedState state;
  };
  /// Notes that `state`, which may be kept, is held beside all kept ones, the caller's and `more` others.
  void count(const SharedState& state, std::size_t more);

  const Model* model_;
  const VectorXd* native_;
  const Trajectory* run_;
  std::vector<Kept> kept_;           ///< ascending; the start of the run first
  std::weak_ptr<const State> last_;  ///< what the caller got; empty for a state of the run
  CheckpointReport report_;
};

}  // namespace rhytid::adjoint
