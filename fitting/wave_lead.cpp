#include "fitting/wave_lead.h"

#include <chrono>
#include <cmath>
#include <cstdio>

namespace rhytid::fitting {

WaveLead::WaveLead(const JointFitInput& input, const FitObserver& observer)
    : problem_(input.clips, input.options) {
  problem_.on_run = observer.run;
  problem_.stop_when(observer.should_stop);
  JointFitInput own = input;
  if (!own.evaluations.empty()) own.evaluations += "/waves";
  logs_.emplace(own, problem_, observer.note);
}

LocalFit WaveLead::both_ways(JointProblem& points, const LocalFit& local_fit) {
  return [this, &points, local_fit](Search& search) {
    const auto begin = std::chrono::steady_clock::now();
    const int runs_before = problem_.forward_runs();
    Search with_waves(problem_, search.all(search.initial()));
    OptimiserOutcome outcome = local_fit(with_waves);
    if (problem_.was_stopped()) return outcome;
    using Status = OptimiserOutcome::Status;
    Led& led = led_.emplace_back();
    led.stage.change = "waves besides points";
    led.stage.status = outcome.status == Status::converged         ? "converged"
                       : outcome.status == Status::max_evaluations ? "max_evaluations"
                                                                   : "failed: " + outcome.detail;
    led.stage.forward_runs = problem_.forward_runs() - runs_before;
    led.from_waves = search.all(search.initial());
    if (std::isfinite(outcome.cost) && outcome.t.size() > 0)
      led.from_waves = outcome.t, led.stage.cost = outcome.cost;
    const VectorXd values = problem_.values(led.from_waves);
    led.stage.values.assign(values.begin(), values.end());
    led.stage.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    Search of_points(points, led.from_waves);
    outcome = local_fit(of_points);
    led.end = outcome.t;
    return outcome;
  };
}

const WaveLead::Led* WaveLead::to(const VectorXd& best) const {
  for (const Led& led : led_)
    if (led.end.size() == best.size() && led.end == best) return &led;
  return nullptr;
}

void WaveLead::add_runs(StartsOutcome& starts) const {
  for (SearchedStart& start : starts.starts)
    if (const Led* led = start.was_searched ? to(start.outcome.t) : nullptr)
      start.forward_runs += led->stage.forward_runs;
}

void WaveLead::add_stage(const VectorXd& best, FitResult& result) const {
  if (const Led* led = to(best)) result.stages.push_back(led->stage);
}

void WaveLead::add_note(const VectorXd& best, const Identifiability& found, FitResult& result) const {
  const Led* led = to(best);
  if (led == nullptr) return;
  double most = 0;
  Eigen::Index which = 0;
  for (Eigen::Index k = 0; k < best.size(); ++k) {
    const double deviations = std::fabs(best[k] - led->from_waves[k]) / found.sigma(static_cast<int>(k));
    if (deviations > most) most = deviations, which = k;
  }
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", most);
  result.notes.push_back(
      "Waves led the search, which then went on with the points alone: from where waves had led it that "
      "moved " +
      problem_.variables()[static_cast<std::size_t>(which)].name + " by " + text +
      " of its deviations, other parameters by no more. The answer, and all that is said of it, is that of "
      "the "
      "points" +
      (most > 3 ? "; points and waves do not agree." : "."));
}

}  // namespace rhytid::fitting
