#include "adjoint/taylor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "adjoint/output_values.h"
#include "adjoint/run_states.h"
#include "sim/core/error.h"
#include "sim/time/step_passes.h"

namespace rhytid::adjoint {

namespace {

// A deep remainder is looked at again this much closer, and is noise when c₁h + c₂h² misses it by more than this share
// of its larger part (is_smooth).
constexpr double kCloseBy = 0.8, kSmooth = 0.1;
constexpr double kNoiseStep = 1e-8;  // h² is then below rounding, yet the solver has work to do

/// Whether the last two remainders and one more, `again` at kCloseBy of the last step, lie on c₁h + c₂h²: what an error
/// of the gradient leaves is a smooth function of h, a run that ended at a residual far above those that the noise was
/// measured from is not. c₂ is that of the last remainder but one, where it dominates.
bool is_smooth(const TaylorSeries& series, double again) {
  const std::size_t n = series.remainders.size();
  const double h = series.steps[n - 2], d = series.steps[n - 1], c2 = series.remainders[n - 2] / (h * h),
               c1 = series.remainders[n - 1] / d - c2 * d;
  const double expected = kCloseBy * d * c1 + kCloseBy * kCloseBy * d * d * c2;
  return std::fabs(again - expected) <= kSmooth * std::max(std::fabs(c1) * d, std::fabs(c2) * d * d);
}

/// Takes the last remainder, and another beside it, for noise: removes it from the series.
void raise_noise(TaylorSeries& series, double again) {
  series.noise = std::max({series.noise, std::fabs(series.remainders.back()), std::fabs(again)});
  series.steps.pop_back();
  series.slopes.pop_back();
  series.remainders.pop_back();
  series.switches.pop_back();
}

/// Whether the last `count` slopes lie in the window.
bool is_clean(const TaylorSeries& series, const TaylorOptions& options, int count) {
  if (static_cast<int>(series.slopes.size()) < count) return false;
  return std::all_of(series.slopes.end() - count, series.slopes.end(),
                     [&](double s) { return s >= options.smallest_slope && s <= options.largest_slope; });
}

std::string text(const char* format, auto... values) {
  char buffer[320];
  std::snprintf(buffer, sizeof buffer, format, values...);
  return buffer;
}

void judge(TaylorSeries& s, const TaylorOptions& options, int wanted, bool at_noise,
           const std::string& failure) {
  const std::size_t n = s.remainders.size();
  if (n >= 2) {
    // ρ = c₁h + c₂h² through the last two points.
    const double h = s.steps[n - 2], q = s.steps[n - 1] / h;
    const double c1 = (s.remainders[n - 1] / (q * q) - s.remainders[n - 2]) / (h * (1 / q - 1));
    s.first_order_error = std::fabs(c1) / std::max(std::fabs(s.linear), 1e-300);
  }
  s.passed = failure.empty() && is_clean(s, options, wanted);
  if (!failure.empty()) {
    s.sentence = "the run could not be repeated at a nearby parameter: " + failure;
  } else if (s.passed) {
    s.sentence = text(
        "slopes between %.3f and %.3f from h = %.1e down to %.1e, where %ld contact or stick points switch; "
        "the "
        "gradient is right to %.0e",
        *std::min_element(s.slopes.end() - wanted, s.slopes.end()),
        *std::max_element(s.slopes.end() - wanted, s.slopes.end()), s.steps[s.steps.size() - wanted - 1],
        s.steps.back(), s.switches.back(), s.first_order_error);
  } else if (at_noise) {
    s.sentence = text(
        "no %d slopes in the window before the remainder (%.1e at h = %.1e) sank to the noise of the "
        "functional (%.1e)",
        wanted, std::fabs(s.remainders.back()), s.steps.back(), s.noise);
  } else {
    const double last = s.slopes.empty() ? 0 : s.slopes.back();
    s.sentence = text(
        "slope %.3f at h = %.1e where a right gradient gives 2; %ld contact or stick points switch; relative "
        "error of the gradient about %.0e",
        last, s.steps.empty() ? 0 : s.steps.back(), s.switches.empty() ? 0L : s.switches.back(),
        s.first_order_error);
  }
}

}  // namespace

FunctionalDifference::FunctionalDifference(const SceneModel& scene_model, const Trajectory& run,
                                           const Output& output, const std::vector<VectorXd>& weights,
                                           const MinimiserOptions& minimiser)
    : scene_model_(&scene_model), run_(&run), output_(&output), weights_(&weights), minimiser_(minimiser) {
  require(run.complete, "FunctionalDifference: the run must be complete");
  require(static_cast<int>(weights.size()) == run.frames() + 1,
          "FunctionalDifference: weights for every frame");
  const VectorXd native = scene_model.native();
  values_ = output_values(model(), native, run, output);
  SharedState old = first_state(run);
  for (int i = 0; i < static_cast<int>(run.steps.size()); ++i) {
    StepPasses passes(model(), native, run.steps[i].step, *old, run.steps[i].earlier_passes);
    regimes_.push_back(step_regimes(passes.last(), run.steps[i].state.u));
    old = state_after(run, i, passes);
  }
}

double FunctionalDifference::difference(const Trajectory& other) const {
  const std::vector<VectorXd> values = output_values(model(), scene_model_->native(), other, *output_);
  double sum = 0;
  for (int f = 0; f <= run_->frames(); ++f)
    if (output_->size(f) > 0) sum += (*weights_)[f].dot(values[f] - values_[f]);
  return sum;
}

double FunctionalDifference::rounding() const {
  double sum = 0;
  for (int f = 0; f <= run_->frames(); ++f)
    if (output_->size(f) > 0) sum += (*weights_)[f].cwiseAbs().dot(values_[f].cwiseAbs());
  return std::numeric_limits<double>::epsilon() * sum;
}

FunctionalDifference::Result FunctionalDifference::evaluate(const VectorXd& native, const StartGuess& guess,
                                                            const std::function<bool()>& go_on) const {
  Result result;
  int frame = run_->frame_end.front() == 0 ? 1 : 0;
  const auto observe = [&](int step, const StepProblem& problem, const State& state) {
    const std::vector<signed char> now = step_regimes(problem, state.u);
    for (std::size_t q = 0; q < now.size(); ++q) result.switches += now[q] != regimes_[step][q];
    for (; frame <= run_->frames() && run_->frame_end[frame] == step + 1; ++frame)
      if (output_->size(frame) > 0)
        result.difference +=
            (*weights_)[frame].dot(output_->step_values(frame, problem, state) - values_[frame]);
    return !go_on || go_on();
  };
  const auto nominal = [this](int step, const State&) { return run_->steps[step].state.u; };
  result.run = resimulate(model(), native, *run_, minimiser_, guess ? guess : StartGuess(nominal), observe);
  result.complete = result.run.complete;
  result.failure = result.run.failure;
  for (const StepRecord& record : result.run.steps) result.iterations += record.report.iterations;
  return result;
}

double measure_noise(const FunctionalDifference& functional, const ParameterSpace& space,
                     const VectorXd& direction, const std::function<bool()>& go_on) {
  // Of three the middle one: roundings may cancel by chance, and a noise that is told too small lets a series go down
  // into the true one; and a run may end with a residual far above those of the others, which says nothing of these.
  std::array<double, 3> noise{};
  constexpr std::array<double, 3> scales = {1.0, -0.83, 0.61};
  for (std::size_t k = 0; k < noise.size(); ++k) {
    const VectorXd v = direction * (scales[k] * kNoiseStep / direction.cwiseAbs().maxCoeff());
    const auto whole = functional.evaluate(space.native(v), {}, go_on);
    const auto half = functional.evaluate(space.native(0.5 * v), {}, go_on);
    noise[k] = std::fabs(whole.difference - 2 * half.difference);
  }
  std::sort(noise.begin(), noise.end());
  // Runs that a step does not change can have the same bits, which says nothing of those that it does.
  return noise[1] > 0 ? noise[1] : std::max(noise[2], functional.rounding());
}

TaylorSeries taylor_test(const FunctionalDifference& functional, const ParameterSpace& space,
                         const VectorXd& direction, const VectorXd& gradient, double noise,
                         const TaylorOptions& options, const std::function<bool()>& go_on) {
  require(direction.size() == space.size() && gradient.size() == space.size(),
          "taylor_test: one component per parameter");
  require(direction.cwiseAbs().maxCoeff() > 0, "taylor_test: the direction is zero");
  const VectorXd v = direction / direction.cwiseAbs().maxCoeff();
  TaylorSeries series;
  series.linear = gradient.dot(v);
  std::string failure;
  Trajectory last;
  double last_step = 0;
  // Displacements change linearly but for O(h²): start from the last evaluation, scaled.
  const auto at = [&](double h) {
    StartGuess guess;
    if (last.complete)
      guess = [&, scale = h / last_step](int step, const State&) {
        const VectorXd& u = functional.run().steps[step].state.u;
        return VectorXd(u + scale * (last.steps[step].state.u - u));
      };
    FunctionalDifference::Result r = functional.evaluate(space.native(h * v), guess, go_on);
    if (!r.complete) failure = r.failure;
    last = std::move(r.run);
    last_step = h;
    return std::pair(r.difference - h * series.linear, r.switches);
  };

  const auto evaluate = [&](double h) {
    const auto [remainder, switches] = at(h);
    if (!failure.empty()) return false;
    if (!series.steps.empty())
      series.slopes.push_back(std::log(std::fabs(series.remainders.back() / remainder)) /
                              std::log(series.steps.back() / h));
    series.steps.push_back(h);
    series.remainders.push_back(remainder);
    series.switches.push_back(switches);
    return true;
  };

  series.noise = noise;
  int wanted = options.clean_slopes;
  bool at_noise = false;
  double h = options.first_step;
  for (int k = 0; k < options.max_evaluations && !at_noise && evaluate(h); ++k) {
    if (is_clean(series, options, wanted)) break;
    at_noise = std::fabs(series.remainders.back()) < options.noise_factor * noise;
    h /= series.switches.back() > options.many_switches ? 8 : 2;
  }
  if (failure.empty() && is_clean(series, options, wanted)) {
    // A small error of the gradient hides below a large parabola: once more as far down as the noise allows.
    const double curvature = std::fabs(series.remainders.back()) / (h * h);
    const auto look_deeper = [&] {
      const double deep = std::max(h / 1024, std::sqrt(1e3 * series.noise / curvature));
      return deep < h / 8 && evaluate(deep);
    };
    // The remainder at the deepest step again a little closer. It may not start from the run there, or it would inherit
    // its end.
    const auto close_by = [&] {
      last = {};
      return at(kCloseBy * series.steps.back()).first;
    };
    if (look_deeper()) {
      if (is_clean(series, options, 1)) {
        ++wanted;
      } else if (const double again = close_by(); !failure.empty() || is_smooth(series, again)) {
        ++wanted;
      } else {
        raise_noise(series, again);
        if (look_deeper()) ++wanted;
      }
    }
  }
  judge(series, options, wanted, at_noise, failure);
  return series;
}

}  // namespace rhytid::adjoint
