#include "fitting/difference_shifts.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <utility>

#include "fitting/fit_logs.h"
#include "fitting/residual_signature.h"
#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

/// By how much predictions differ, over all observations that both have.
struct Change {
  VectorXd whitened;  ///< rows as in the linearisation
  double squares = 0;
  int count = 0;

  /// Of one clip, whose rows begin at `row`; tracks that only one of both could attach stay as they are.
  void add(const FitProblem& clip, const FitEvaluation& at, const FitProblem& other,
           const FitEvaluation& other_at, Eigen::Index row) {
    std::map<std::pair<int, int>, std::size_t> of_other;  // camera and track
    for (std::size_t i = 0; i < other.compared().size(); ++i)
      of_other[{other.compared()[i].camera, other.compared()[i].track}] = i;
    for (std::size_t i = 0; i < clip.compared().size(); ++i) {
      const TrackNoise& noise = clip.noise()[i];
      const auto same = of_other.find({clip.compared()[i].camera, clip.compared()[i].track});
      if (same != of_other.end() && other.compared()[same->second].frames == clip.compared()[i].frames) {
        const VectorXd difference = other_at.differences[same->second] - at.differences[i];
        whitened.segment(row, noise.num_rows()) =
            noise.weighted_residual(other_at.differences[same->second], at.tracks[i]) -
            noise.weighted_residual(at.differences[i], at.tracks[i]);
        squares += difference.squaredNorm();
        count += static_cast<int>(difference.size()) / 2;
      }
      row += noise.num_rows();
    }
    whitened.segment(row, at.measured.size()) = other_at.measured - at.measured;
  }
};

}  // namespace

std::vector<SystematicShift> difference_shifts(const std::vector<OtherFit>& others, JointProblem& problem,
                                               const VectorXd& t, const FitProblem::Linearised& linearised,
                                               const MatrixXd& basis, const FitObserver& observer) {
  std::vector<SystematicShift> shifts;
  for (const OtherFit& fit : others) {
    if (observer.should_stop && observer.should_stop()) return {};
    if (observer.note) observer.note(fit.note);
    SystematicShift& found = shifts.emplace_back();
    found.name = fit.name, found.change = fit.change, found.failure = fit.failure;
    if (!fit.failure.empty()) continue;
    const auto start = std::chrono::steady_clock::now();
    try {
      JointProblem other(fit.input.clips, fit.input.options);
      other.stop_when(observer.should_stop);
      const FitLogs logs(fit.input, other, observer.note);
      const ObjectiveEvaluation& evaluation = other.evaluate(t);
      if (other.was_stopped()) return {};
      if (evaluation.failed) {
        found.failure = evaluation.failure;
        continue;
      }
      Change change{.whitened = VectorXd::Zero(linearised.residuals.size())};
      Eigen::Index row = 0;
      for (int c = 0; c < problem.num_clips(); ++c) {
        const VectorXd own = problem.of_clip(c, t);
        change.add(problem.clip(c), problem.clip(c).evaluate(own), other.clip(c), other.clip(c).evaluate(own),
                   row);
        row += problem.clip(c).num_residuals();
      }
      const VectorXd shift =
          -basis * (basis.transpose() * (linearised.jacobian.transpose() * change.whitened));
      found.shift.assign(shift.begin(), shift.end());
      found.rms_px = std::sqrt(change.squares / std::max(1, change.count));
      add_signature(linearised, basis, change.whitened, {fit.axis}, found);
      found.columns = change.whitened;
    } catch (const InputError& error) {
      found.failure = error.what();
    }
    found.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  return shifts;
}

}  // namespace rhytid::fitting
