#include "adjoint/run_states.h"

#include <algorithm>

#include "adjoint/checkpoint_schedule.h"
#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

/// A pointer to what someone else owns.
SharedState borrowed(const State& state) {
  return {SharedState(), &state};
}

bool has_history(const Model& model, const State& state) {
  return static_cast<std::size_t>(state.history.size()) == model.history_size();
}

SharedState recomputed(const StepRecord& record, StepPasses& passes) {
  State next = passes.last().advance(record.state.u);
  next.velocity.resize(0);  // no equation reads it
  return std::make_shared<const State>(std::move(next));
}

}  // namespace

SharedState first_state(const Trajectory& run) {
  return borrowed(run.initial);
}

SharedState state_after(const Trajectory& run, int i, StepPasses& passes) {
  const StepRecord& record = run.steps[static_cast<std::size_t>(i)];
  if (has_history(passes.last().model(), record.state)) return borrowed(record.state);
  return recomputed(record, passes);
}

ReverseStates::ReverseStates(const Model& model, const VectorXd& native, const Trajectory& run,
                             std::size_t budget)
    : model_(&model), native_(&native), run_(&run) {
  kept_.push_back({0, first_state(run)});
  report_.state_bytes =
      sizeof(double) * (static_cast<std::size_t>(run.initial.u.size()) + model.history_size());
  std::size_t in_use = 3;
  for (const StepRecord& record : run.steps) in_use = std::max(in_use, 3 + record.earlier_passes.size());
  const std::size_t states = budget / report_.state_bytes;
  const auto useful = static_cast<long>(run.steps.size());
  report_.slots = states <= in_use ? 0 : static_cast<long>(std::min<std::size_t>(states - in_use, useful));
}

void ReverseStates::count(const SharedState& state, std::size_t more) {
  // Those of the run itself have no owner here.
  const bool is_apart = state.use_count() > 0 && state != kept_.back().state;
  const std::size_t held = kept_.size() - 1 + (last_.expired() ? 0 : 1) + (is_apart ? 1 : 0) + more;
  report_.held_bytes = std::max(report_.held_bytes, report_.state_bytes * held);
}

SharedState ReverseStates::after(int steps) {
  const auto has = [this](int i) { return has_history(*model_, run_->before(i)); };
  if (has(steps)) return borrowed(run_->before(steps));
  while (kept_.back().steps > steps) kept_.pop_back();
  int at = kept_.back().steps;
  SharedState state = kept_.back().state;
  // A run may have dropped some histories only: never go back behind the last one that is there.
  for (int i = steps - 1; i > at; --i)
    if (has(i)) at = i, state = borrowed(run_->before(i));
  while (at < steps) {
    const long free = report_.slots - static_cast<long>(kept_.size()) + 1;
    const int target = at + static_cast<int>(checkpoint_distance(steps - at, free));
    for (; at < target; ++at) {
      const StepRecord& record = run_->steps[static_cast<std::size_t>(at)];
      StepPasses passes(*model_, *native_, record.step, *state, record.earlier_passes);
      count(state, record.earlier_passes.size() + 1);
      state = recomputed(record, passes);
      ++report_.recomputed_steps;
    }
    if (at < steps) kept_.push_back({at, state});
  }
  // The caller goes through the passes of the step that starts here.
  const auto next = static_cast<std::size_t>(steps);
  count(state, next < run_->steps.size() ? run_->steps[next].earlier_passes.size() : 0);
  last_ = state;
  return state;
}

}  // namespace rhytid::adjoint
