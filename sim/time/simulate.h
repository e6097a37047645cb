// Quasi-static runs: one implicit step per frame (or substep), bisected when it does not converge, never
// silently.
#pragma once

#include <functional>
#include <vector>

#include "sim/solve/minimise.h"
#include "sim/time/energy_account.h"
#include "sim/time/model.h"

namespace rhytid {

struct RunOptions {
  double frame_rate = 24;  ///< frames per second
  int frames = 0;          ///< frames after the rest frame
  int substeps = 1;        ///< steps per frame
  int frames_done = 0;     ///< frames behind `initial`, when it continues a run that began at time 0
  /// Before frame 0 the skin comes to rest: one step of kSettlingTime that ends at time 0 with the damper
  /// fully relaxed. Needed when the rest shape is under tension (pre-stretch) or held parts are displaced at
  /// time 0 already. It is not taken when frames_done > 0.
  bool settle = false;
  int lag_passes = 1;      ///< solves per step over what terms have for a lag (step_passes.h)
  int max_bisections = 4;  ///< a step that fails is halved at most this often
  MinimiserOptions minimiser;
  bool keep_states = true;  ///< keep every step's state in the trajectory (needed for gradients)
  /// With keep_states: keep their histories too. Without, a state is its displacement alone, a small part of
  /// its memory; sweeps recompute the history from it (adjoint/run_states.h).
  bool keep_histories = true;
  bool account_energies = false;  ///< fill StepRecord::energies (costs about one evaluation per step)
  void validate() const;          ///< throws ContractError naming the field
};

/// Long against every relaxation time, s.
inline constexpr double kSettlingTime = 1e9;

/// One converged step.
struct StepRecord {
  StepInfo step;
  int frame = 0;           ///< frame the step leads to (frame 0 is rest: only the settling step leads there)
  int bisections = 0;      ///< how often the nominal step was halved
  bool softened = false;   ///< its start came from softened penalties (the equations solved are the scene's)
  State state;             ///< after the step (empty when states are not kept; without history, see options)
  MinimiserReport report;  ///< of the last pass, with the counts of all, and the work of attempts given up
  /// How far the last pass moved the skin, largest displacement, mm: what is left of the fixed-point iteration
  /// over the lag of friction. 0 with one pass.
  double pass_change = 0;
  /// Displacements at which the passes before the last ended (empty when states are not kept, or for one
  /// pass).
  std::vector<VectorXd> earlier_passes = {};
  EnergyAccount energies = {};  ///< when RunOptions asks for it
};

struct Trajectory {
  State initial;
  std::vector<StepRecord> steps;
  std::vector<int>
      frame_end;          ///< [frames reached + 1] steps done at the end of each frame; [0] = 0, settled 1
  bool complete = false;  ///< every frame was reached
  std::string failure;    ///< one sentence when not complete
  double seconds = 0;     ///< wall time

  /// Frames reached; −1 when the skin did not even settle to frame 0.
  int frames() const { return static_cast<int>(frame_end.size()) - 1; }
  /// State before step i and at the end of frame f (states kept).
  const State& before(int step) const { return step == 0 ? initial : steps[step - 1].state; }
  const State& at_frame(int frame) const { return before(frame_end[frame]); }
};

/// What an observer is told; everything is valid during the call only.
struct StepEvent {
  const StepProblem& problem;
  const State& state;
  const StepRecord& record;
  bool frame_done;
};

struct RunObserver {
  std::function<void(const StepEvent&)> step;  ///< after every converged step
  std::function<bool(int frame, double t, int iteration, double energy, double residual)>
      iteration;  ///< false = stop
};

/// The last rung of the ladder: the step with all contact penalties softened to at most 1e-6 of the stiffest
/// and back in steps of ten, each start from the solution before it, to a loose tolerance; then the step
/// itself from there. Not converged without contacts. q is the solution if the report says
/// converged.
[[nodiscard]] MinimiserReport solve_step_softened(StepProblem& problem, const MinimiserOptions& options,
                                                  CholeskyFactor& factor, BlockMatrix& matrix, VectorXd& q,
                                                  const IterationCallback& callback = {});

/// A step that fails is halved, at most max_bisections times; then it is tried with softened penalties; then
/// the run ends with a report, and all states before it are kept.
/// Runs from `initial` (rest when null). Step times are fixed by frame rate and substeps, plus bisections; a
/// run continued from a state at frame `frames_done` has the step times, and so the bits, of the whole run.
Trajectory simulate(const Model& model, const VectorXd& native, const RunOptions& options,
                    const RunObserver& observer = {}, const State* initial = nullptr);

}  // namespace rhytid
