#include "adjoint/output_values.h"

#include "adjoint/run_states.h"

namespace rhytid::adjoint {

std::vector<VectorXd> output_values(const Model& model, const VectorXd& native, const Trajectory& run,
                                    const Output& output) {
  std::vector<VectorXd> values;
  SharedState old = first_state(run);
  if (!run.frame_end.empty() && run.frame_end.front() == 0) values.push_back(output.values(0, *old));
  for (int i = 0; i < static_cast<int>(run.steps.size()); ++i) {
    const StepRecord& record = run.steps[static_cast<std::size_t>(i)];
    StepPasses passes(model, native, record.step, *old, record.earlier_passes);
    SharedState state = state_after(run, i, passes);
    while (static_cast<int>(values.size()) <= run.frames() && run.frame_end[values.size()] == i + 1)
      values.push_back(output.step_values(static_cast<int>(values.size()), passes.last(), *state));
    old = std::move(state);
  }
  return values;
}

}  // namespace rhytid::adjoint
