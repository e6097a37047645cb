#include "fitting/starts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <optional>
#include <random>
#include <utility>

#include "fitting/fit_logs.h"
#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid::fitting {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Optima are one where all parameters agree within this part of their deviation.
constexpr double kSame = 0.1;
/// Values are clearly other beyond so many deviations: by as much a parabola would cost 2 w² more, the
/// difference of cost below which the footage does not decide.
constexpr double kOther = 2;

int next_prime(int after) {
  for (int n = after + 1;; ++n) {
    bool is_prime = n > 1;
    for (int d = 2; d * d <= n && is_prime; ++d) is_prime = n % d != 0;
    if (is_prime) return n;
  }
}

/// One coordinate of the sequence. Only integer draws are taken from the generator: distributions of the
/// standard library differ between its implementations.
class HaltonCoordinate {
 public:
  HaltonCoordinate(int base, std::mt19937_64& random) : digits_(base) {
    std::iota(digits_.begin(), digits_.end(), 0);
    for (int i = base - 1; i > 0; --i)
      std::swap(digits_[i], digits_[random() % static_cast<std::uint64_t>(i + 1)]);
    shift_ = static_cast<double>(random() >> 11) * 0x1p-53;
  }
  double operator()(int index) const {
    const int base = static_cast<int>(digits_.size());
    double value = shift_, unit = 1;
    for (; index > 0; index /= base) value += digits_[index % base] * (unit /= base);
    return value - std::floor(value);
  }

 private:
  std::vector<int> digits_;
  double shift_ = 0;
};

/// u_k: what a unit of the spread is.
double unit_of(const FitVariable& v) {
  if (!v.moves.empty() && v.prior_sigma) return *v.prior_sigma;  // of its wide bounds a quarter is far off
  return v.transform == ParameterTransform::none ? 0.25 * (v.upper - v.lower) : 1;
}

std::string text_of(const char* pattern, double x) {
  char text[48];
  std::snprintf(text, sizeof(text), pattern, x);
  return text;
}

/// The starts to search from: the case's own, then the cheapest others.
std::vector<int> chosen(const std::vector<SearchedStart>& starts, int local_fits) {
  std::vector<int> others;
  for (int i = 1; i < static_cast<int>(starts.size()); ++i)
    if (std::isfinite(starts[i].screened_cost)) others.push_back(i);
  std::stable_sort(others.begin(), others.end(),
                   [&](int a, int b) { return starts[a].screened_cost < starts[b].screened_cost; });
  others.resize(std::min<std::size_t>(others.size(), local_fits - 1));
  others.insert(others.begin(), 0);
  return others;
}

/// The frames that starts are compared on end here.
int last_screened_frame(const JointProblem& problem, const FitCase& options) {
  int last = 0;
  for (int c = 0; c < problem.num_clips(); ++c) last = std::max(last, problem.clip(c).frames());
  const int first = std::max(1, options.first_frame), count = std::max(1, last - first + 1);
  const int screened = options.screen_frames > 0 ? options.screen_frames : (count + 1) / 2;
  return std::min(last, first - 1 + screened);
}

/// By how many deviations two points differ in parameter k; 0 where it is not determined.
class Distance {
 public:
  Distance(const JointProblem& problem, const FitResult& result) {
    const bool has_intervals = result.singular_values.size() > 0;
    for (int k = 0; k < problem.num_parameters(); ++k) {
      // Without intervals a tenth of the box stands for a deviation.
      const double sigma = has_intervals ? result.parameters[k].sigma : 0.1 * unit_of(problem.variables()[k]);
      sigma_.push_back(std::isnan(sigma) ? std::numeric_limits<double>::infinity() : sigma);
    }
  }
  double operator()(int k, const VectorXd& a, const VectorXd& b) const {
    return std::fabs(a[k] - b[k]) / sigma_[k];
  }
  double largest(const VectorXd& a, const VectorXd& b) const {
    double d = 0;
    for (int k = 0; k < static_cast<int>(sigma_.size()); ++k) d = std::max(d, (*this)(k, a, b));
    return d;
  }

 private:
  std::vector<double> sigma_;
};

std::string status_word(const OptimiserOutcome& outcome) {
  using Status = OptimiserOutcome::Status;
  return outcome.status == Status::converged         ? "converged"
         : outcome.status == Status::max_evaluations ? "max_evaluations"
                                                     : "failed: " + outcome.detail;
}

/// Starts whose optimum is one of these, in the order of cost.
std::vector<std::vector<int>> merged(const StartsOutcome& found, const Distance& distance) {
  std::vector<int> order;
  for (int i = 0; i < static_cast<int>(found.starts.size()); ++i)
    if (found.starts[i].was_searched && std::isfinite(found.starts[i].outcome.cost)) order.push_back(i);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return found.starts[a].outcome.cost < found.starts[b].outcome.cost; });
  std::vector<std::vector<int>> optima;
  for (const int i : order) {
    const auto same = std::find_if(optima.begin(), optima.end(), [&](const std::vector<int>& optimum) {
      return distance.largest(found.starts[optimum[0]].outcome.t, found.starts[i].outcome.t) <= kSame;
    });
    if (same == optima.end())
      optima.push_back({i});
    else
      same->push_back(i);
  }
  return optima;
}

/// What differs clearly between the best point and another: "film youngs_modulus 0.5 instead of 1.02 MPa".
std::string other_values(const JointProblem& problem, const Distance& distance, const VectorXd& best,
                         const VectorXd& other) {
  std::string list;
  for (int k = 0; k < problem.num_parameters(); ++k) {
    const FitVariable& v = problem.variables()[k];
    if (!(distance(k, best, other) > kOther)) continue;
    list += (list.empty() ? "" : ", ") + v.name + text_of(" %.4g", v.to_parameter(other[k])) + " instead of" +
            text_of(" %.4g", v.to_parameter(best[k])) + (v.unit.empty() ? "" : " " + v.unit);
  }
  return list;
}

}  // namespace

std::vector<VectorXd> start_points(const Objective& objective, const StartOptions& options) {
  require(options.starts > 0 && options.local_fits > 0 && options.spread > 0,
          "start_points: starts, local fits and spread are positive");
  const VectorXd lower = objective.lower(), upper = objective.upper();
  const VectorXd first = options.first.size() > 0 ? options.first : objective.initial();
  std::vector<VectorXd> points = {first.cwiseMax(lower).cwiseMin(upper)};
  points.resize(options.starts, points[0]);
  std::mt19937_64 random(options.seed);
  int base = 1;
  for (int k = 0; k < objective.num_parameters(); ++k) {
    const HaltonCoordinate place(base = next_prime(base), random);
    const double reach = options.spread * unit_of(objective.variables()[k]);
    const double low = std::max(lower[k], points[0][k] - reach),
                 high = std::min(upper[k], points[0][k] + reach);
    for (int i = 1; i < options.starts; ++i) points[i][k] = low + (high - low) * place(i);
  }
  return points;
}

StartsOutcome search_from_starts(Objective& screen, Objective& objective, const StartOptions& options,
                                 const LocalFit& local_fit,
                                 const std::function<void(const std::string&)>& tell) {
  StartsOutcome found;
  for (const VectorXd& t : start_points(objective, options))
    found.starts.push_back({.t = t, .screened_cost = kNone, .failure = {}, .outcome = {}});
  const auto say = [&](const std::string& text) {
    if (tell) tell(text);
  };
  const int screened_before = screen.forward_runs();
  const bool is_apart = &screen != &objective;
  for (std::size_t i = 0; i < found.starts.size() && options.starts > 1; ++i) {
    SearchedStart& start = found.starts[i];
    const ObjectiveEvaluation& at = screen.evaluate(start.t);
    if (screen.was_stopped()) {
      found.starts[0].outcome.status = OptimiserOutcome::Status::stopped;
      return found;
    }
    if (at.failed)
      start.failure = at.failure;
    else
      start.screened_cost = at.cost;
  }
  found.screening_runs = is_apart ? screen.forward_runs() - screened_before : 0;
  bool has_winner = false;
  for (const int i : chosen(found.starts, options.local_fits)) {
    SearchedStart& start = found.starts[i];
    if (options.starts > 1) say("search from start " + std::to_string(i));
    const int runs_before = objective.forward_runs();
    Search search(objective, start.t);
    start.outcome = local_fit(search);
    start.was_searched = true;
    start.forward_runs = objective.forward_runs() - runs_before;
    for (FitIteration& step : start.outcome.history) step.evaluations -= runs_before;
    if (objective.was_stopped()) {
      found.winner = i;
      return found;
    }
    if (!std::isfinite(start.outcome.cost)) continue;
    if (!has_winner || start.outcome.cost < found.best().cost) found.winner = i;
    has_winner = true;
  }
  return found;
}

StartsOutcome fit_from_starts(const JointFitInput& input, JointProblem& problem, const VectorXd& first,
                              const LocalFit& local_fit, const FitObserver& observer) {
  const StartOptions options{.starts = input.options.starts,
                             .local_fits = input.options.local_fits,
                             .spread = input.options.start_spread,
                             .seed = input.options.seed,
                             .first = first};
  if (options.starts == 1) return search_from_starts(problem, problem, options, local_fit);
  JointFitInput early = input;
  early.options.last_frame = last_screened_frame(problem, input.options);
  if (!early.evaluations.empty()) early.evaluations += "/screen";
  int last = 0;
  for (int c = 0; c < problem.num_clips(); ++c) last = std::max(last, problem.clip(c).frames());
  std::optional<JointProblem> screen;
  if (early.options.last_frame < last) {
    try {
      screen.emplace(early.clips, early.options);
    } catch (const InputError& error) {  // too few observations in these frames
      early.options.last_frame = last;
      if (observer.note) observer.note(std::string("starts are compared on all frames: ") + error.what());
    }
  }
  std::optional<FitLogs> logs;
  int screened = 0;
  if (screen) {
    screen->stop_when(observer.should_stop);
    logs.emplace(early, *screen, observer.note);
    screen->on_run = [&](const FitProgress& run) {
      screened = run.forward_runs;
      if (observer.run) observer.run(run);
    };
    problem.on_run = [&](FitProgress run) {
      run.forward_runs += screened;
      if (observer.run) observer.run(run);
    };
  }
  if (observer.note)
    observer.note("screening " + std::to_string(options.starts) + " starts on frames " +
                  std::to_string(std::max(1, early.options.first_frame)) + " to " +
                  std::to_string(early.options.last_frame));
  StartsOutcome found =
      search_from_starts(screen ? *screen : problem, problem, options, local_fit, observer.note);
  found.screened_frames = early.options.last_frame;
  problem.on_run = [run = observer.run, screened](FitProgress p) {
    p.forward_runs += screened;
    if (run) run(p);
  };
  return found;
}

void add_starts(const JointProblem& problem, const StartsOutcome& found, const FitCase& options,
                double widening, FitResult& result) {
  if (found.starts.size() < 2) return;
  const auto values = [&problem](const VectorXd& t) {
    const VectorXd p = problem.values(t);
    return std::vector<double>(p.begin(), p.end());
  };
  std::vector<int> failed;
  int runs = 0, searched = 0;
  for (std::size_t i = 0; i < found.starts.size(); ++i) {
    const SearchedStart& from = found.starts[i];
    FittedStart& start = result.starts.emplace_back();
    start.initial = values(from.t);
    start.screened_cost = from.screened_cost;
    start.failure = from.failure;
    if (!from.failure.empty()) failed.push_back(static_cast<int>(i));
    if (!from.was_searched) continue;
    ++searched;
    runs += start.forward_runs = from.forward_runs;
    start.status = status_word(from.outcome);
    for (const FitIteration& step : from.outcome.history) {
      start.evaluations.push_back(step.evaluations);
      start.costs.push_back(step.cost);
    }
    if (!std::isfinite(from.outcome.cost)) continue;
    start.final_cost = from.outcome.cost;
    start.values = values(from.outcome.t);
  }
  const Distance distance(problem, result);
  const std::vector<std::vector<int>> optima = merged(found, distance);
  for (std::size_t m = 0; m < optima.size(); ++m)
    for (const int i : optima[m]) result.starts[i].optimum = static_cast<int>(m) + 1;

  result.notes.push_back("Starts: " + std::to_string(found.starts.size()) + " (seed " +
                         std::to_string(options.seed) + text_of(", spread %.4g", options.start_spread) +
                         "), compared on frames " + std::to_string(std::max(1, options.first_frame)) +
                         " to " + std::to_string(found.screened_frames) + " by one run each; searches from " +
                         std::to_string(searched) + " of them took " + counted(runs, "run") + " and found " +
                         (optima.size() == 1 ? "one optimum" : std::to_string(optima.size()) + " optima") +
                         "; the best is from start " + std::to_string(found.winner) + ".");
  if (!failed.empty()) {
    std::string list;
    for (const int i : failed) list += (list.empty() ? " " : ", ") + std::to_string(i);
    result.notes.push_back(counted(static_cast<long>(failed.size()), "start") + " could not be run (" +
                           list.substr(1) + "): " + result.starts[failed[0]].failure);
  }
  for (std::size_t i = 0; i < result.starts.size(); ++i)
    if (result.starts[i].status.starts_with("failed"))
      result.notes.push_back("The search from start " + std::to_string(i) + " " + result.starts[i].status);
  if (optima.empty()) return;
  const OptimiserOutcome& best = found.best();
  const OptimiserOutcome& own = found.starts[0].outcome;
  if (result.starts[0].optimum > 1 && own.cost - best.cost > kOther * widening * widening)
    result.notes.push_back("From the start of the case alone the fit would have ended at cost " +
                           text_of("%.6g", own.cost) + " instead of " + text_of("%.6g", best.cost) + ".");
  for (std::size_t m = 1; m < optima.size(); ++m) {
    const OptimiserOutcome& other = found.starts[optima[m][0]].outcome;
    const double more = other.cost - best.cost;
    if (!(more < kOther * widening * widening) || !(distance.largest(best.t, other.t) > kOther)) continue;
    result.cannot_tell.push_back(
        "Another optimum (start " + std::to_string(optima[m][0]) +
        (other.status == OptimiserOutcome::Status::converged ? "" : ", not converged") + ") costs only " +
        text_of("%.3g", more) + " more, with " + other_values(problem, distance, best.t, other.t) +
        ": this footage does not decide between them.");
  }
}

}  // namespace rhytid::fitting
