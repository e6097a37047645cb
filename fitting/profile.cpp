#include "fitting/profile.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid::fitting {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// 99.5 % over 97.5 % quantile of the normal law: a side is followed to the 99 % level.
constexpr double kBeyond = 2.5758293035489004 / 1.959963984540054;
/// Where the last of the steps leaves a side open, it goes on in growing steps, and then to the bound.
constexpr double kGrowth = 1.5;
constexpr int kFurtherSteps = 4;

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.4g", x);
  return text;
}

double deviance(double cost, double best_cost, double widening) {
  return 2 * (cost - best_cost) / (widening * widening);
}

std::string status_word(const OptimiserOutcome& outcome) {
  using Status = OptimiserOutcome::Status;
  return outcome.status == Status::converged         ? "converged"
         : outcome.status == Status::max_evaluations ? "max_evaluations"
                                                     : "failed: " + outcome.detail;
}

/// One side of a profile.
class Side {
 public:
  Side(Objective& objective, int k, const ProfileScale& scale, const LocalFit& local_fit,
       const ProfiledPoint& best)
      : objective_(objective), k_(k), scale_(scale), local_fit_(local_fit), best_(best) {}

  /// `direction` ±1; points come out going outward.
  std::vector<ProfiledPoint> points(int direction, const std::vector<double>& steps, std::string& failure) {
    std::vector<ProfiledPoint> found;
    const double bound = direction > 0 ? objective_.upper()[k_] : objective_.lower()[k_];
    const double room = direction * (bound - best_.t_k);
    if (!(room > 0)) return found;
    const double unit = std::min(scale_.sigma, room / steps.back());
    double reach = 0;
    for (std::size_t i = 0; reach < room; ++i) {
      const bool is_further = i >= steps.size();
      const double root = found.empty() ? 0 : root_of(found.back());
      if (root > (is_further ? 1 : kBeyond) * scale_.quantile) break;
      reach = !is_further ? steps[i] * unit : i < steps.size() + kFurtherSteps ? kGrowth * reach : room;
      const bool is_last = reach > room * (1 - 1e-9);
      if (is_last) reach = room;
      const ProfiledPoint& from = found.empty() ? best_ : found.back();
      ProfiledPoint point = refit(from, is_last ? bound : best_.t_k + direction * reach);
      if (objective_.was_stopped()) break;
      if (!std::isfinite(point.cost)) {
        failure = point.status;
        spent_ += point.forward_runs;
        break;
      }
      found.push_back(std::move(point));
    }
    return found;
  }
  int spent() const { return spent_; }  ///< runs of points that could not be had

 private:
  double root_of(const ProfiledPoint& point) const {
    return std::sqrt(std::max(0.0, deviance(point.cost, best_.cost, scale_.widening)));
  }

  /// Along the parabola's valley from a neighbour; where that cannot be run, from the neighbour's own values.
  ProfiledPoint refit(const ProfiledPoint& from, double t_k) {
    const int runs_before = objective_.forward_runs();
    ProfiledPoint point = search(from.t + (t_k - from.t_k) * scale_.valley, t_k);
    if (!std::isfinite(point.cost) && !objective_.was_stopped()) point = search(from.t, t_k);
    point.forward_runs = objective_.forward_runs() - runs_before;
    return point;
  }

  ProfiledPoint search(VectorXd start, double t_k) {
    start[k_] = t_k;
    start = start.cwiseMax(objective_.lower()).cwiseMin(objective_.upper());
    ProfiledPoint point{.t_k = t_k, .cost = kInfinity, .t = start, .status = {}};
    if (objective_.num_parameters() == 1) {
      const ObjectiveEvaluation& at = objective_.evaluate(start);
      point.status = at.failed ? "failed: " + at.failure : "converged";
      if (!at.failed) point.cost = at.cost;
      return point;
    }
    Search search(objective_, start, {k_});
    const OptimiserOutcome outcome = local_fit_(search);
    point.cost = outcome.cost;
    if (std::isfinite(outcome.cost)) point.t = outcome.t;
    point.status = status_word(outcome);
    return point;
  }

  Objective& objective_;
  int k_;
  const ProfileScale& scale_;
  const LocalFit& local_fit_;
  const ProfiledPoint& best_;
  int spent_ = 0;
};

/// Slopes at the points of a cubic that is monotone where they are.
std::vector<double> monotone_slopes(const std::vector<double>& x, const std::vector<double>& y) {
  const std::size_t n = x.size();
  std::vector<double> secant(n - 1), slope(n);
  for (std::size_t i = 0; i + 1 < n; ++i) secant[i] = (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
  slope.front() = secant.front();
  slope.back() = secant.back();
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double before = x[i] - x[i - 1], after = x[i + 1] - x[i];
    if (!(secant[i - 1] * secant[i] > 0)) continue;
    slope[i] =
        3 * (before + after) / ((2 * after + before) / secant[i - 1] + (after + 2 * before) / secant[i]);
  }
  return slope;
}

/// "is not bounded above within its bounds: up to 10 MPa ..."; empty where there is a crossing.
std::string open_side(const FitVariable& v, const Profile& profile, const ProfileScale& scale, bool is_above,
                      double bound) {
  if ((is_above ? profile.high : profile.low).has_value()) return {};
  const ProfiledPoint& end = is_above ? profile.points.back() : profile.points.front();
  const std::string side = is_above ? "above" : "below", unit = v.unit.empty() ? "" : " " + v.unit;
  const std::string value = number(std::clamp(v.to_parameter(end.t_k), v.lower, v.upper)) + unit;
  const auto optimum = std::find_if(profile.points.begin(), profile.points.end(),
                                    [](const ProfiledPoint& p) { return p.status == "optimum"; });
  if (optimum->t_k == end.t_k && (is_above ? profile.failure_above : profile.failure_below).empty())
    return v.name + " is not bounded " + side + ": its best value is at its bound " + value + ".";
  const std::string rise = number(std::max(0.0, deviance(end.cost, optimum->cost, scale.widening)));
  const std::string level =
      "2ΔF/w² is " + rise + " there, below the 95 % level " + number(scale.quantile * scale.quantile) + ".";
  if (end.t_k == bound)
    return v.name + " is not bounded " + side + " within its bounds: at " + value + " " + level;
  return v.name + " is not bounded " + side + " as far as its profile goes: at " + value + " " + level +
         " Beyond, the search " + (is_above ? profile.failure_above : profile.failure_below) + ".";
}

/// Costs this much lower than the answer's are more than what a search leaves undone.
double noticeable(double cost, double widening) {
  return std::max(0.02 * widening * widening, 4e-6 * std::fabs(cost));
}

}  // namespace

ProfileScale profile_scale(const Identifiability& found, int parameter, double widening) {
  const Eigen::Index n = found.basis().rows();
  const VectorXd g = VectorXd::Unit(n, parameter);
  ProfileScale scale{.sigma = found.noise_sigma(g), .widening = widening, .valley = g};
  if (!std::isfinite(scale.sigma)) return scale;  // the valley is level: any way is as good
  const VectorXd row = found.basis().transpose() * g;
  scale.widening = scale.sigma / row.norm();
  scale.quantile = student_quantile_975(found.degrees(g));
  scale.valley = found.basis() * row / row.squaredNorm();
  scale.valley[parameter] = 1;
  return scale;
}

std::optional<double> last_crossing(const std::vector<double>& x, const std::vector<double>& y,
                                    double level) {
  require(x.size() == y.size(), "last_crossing: one y for each x");
  if (x.size() < 2) return std::nullopt;
  const std::vector<double> slope = monotone_slopes(x, y);
  for (std::size_t i = x.size() - 1; i-- > 0;) {
    if (!(y[i] < level && level <= y[i + 1])) continue;
    const double h = x[i + 1] - x[i];
    double low = 0, high = 1;
    for (int round = 0; round < 60; ++round) {
      const double s = 0.5 * (low + high), s2 = s * s, s3 = s2 * s;
      const double value = (2 * s3 - 3 * s2 + 1) * y[i] + (s3 - 2 * s2 + s) * h * slope[i] +
                           (3 * s2 - 2 * s3) * y[i + 1] + (s3 - s2) * h * slope[i + 1];
      (value < level ? low : high) = s;
    }
    return x[i] + 0.5 * (low + high) * h;
  }
  return std::nullopt;
}

Profile profile_of(Objective& objective, int k, const VectorXd& best, double cost, const ProfileScale& scale,
                   const LocalFit& local_fit, const std::vector<double>& steps) {
  require(best.size() == objective.num_parameters() && scale.valley.size() == best.size(),
          "profile_of: one value per parameter");
  require(!steps.empty() && steps.front() > 0 && std::is_sorted(steps.begin(), steps.end()),
          "profile_of: steps are positive and ascending");
  const ProfiledPoint optimum{.t_k = best[k], .cost = cost, .t = best, .status = "optimum"};
  Profile profile;
  Side side(objective, k, scale, local_fit, optimum);
  profile.points = side.points(-1, steps, profile.failure_below);
  std::reverse(profile.points.begin(), profile.points.end());
  profile.points.push_back(optimum);
  for (ProfiledPoint& point : side.points(1, steps, profile.failure_above))
    profile.points.push_back(std::move(point));
  profile.forward_runs = side.spent();
  std::vector<double> x, root, mirrored_x, mirrored_root;
  for (const ProfiledPoint& point : profile.points) {
    profile.forward_runs += point.forward_runs;
    x.push_back(point.t_k);
    root.push_back(std::copysign(std::sqrt(std::max(0.0, deviance(point.cost, cost, scale.widening))),
                                 point.t_k - optimum.t_k));
  }
  for (std::size_t i = x.size(); i-- > 0;) {
    mirrored_x.push_back(-x[i]);
    mirrored_root.push_back(-root[i]);
  }
  profile.high = last_crossing(x, root, scale.quantile);
  profile.low = last_crossing(mirrored_x, mirrored_root, scale.quantile);
  if (profile.low) *profile.low = -*profile.low;
  return profile;
}

std::vector<int> profiled_variables(const JointProblem& problem, const std::vector<std::string>& addresses) {
  std::vector<int> variables;
  std::string fitted;
  for (const FitVariable& v : problem.variables()) fitted += (fitted.empty() ? "" : ", ") + v.address;
  for (int k = 0; k < problem.num_parameters(); ++k)
    if (std::find(addresses.begin(), addresses.end(), "all") != addresses.end() ||
        std::find(addresses.begin(), addresses.end(), problem.variables()[k].address) != addresses.end())
      variables.push_back(k);
  for (const std::string& address : addresses)
    if (address != "all" && std::none_of(problem.variables().begin(), problem.variables().end(),
                                         [&](const FitVariable& v) { return v.address == address; }))
      throw InputError("fit: profiles", "'" + address + "'", "all, or a fitted parameter: " + fitted);
  return variables;
}

void add_profiles(JointProblem& problem, const VectorXd& t, const std::vector<int>& variables,
                  const Identifiability& found, double noise_widening, const LocalFit& local_fit,
                  const FitObserver& observer, FitResult& result) {
  if (variables.empty()) return;
  const double cost = problem.evaluate(t).cost;
  int runs = 0;
  double lowest = cost;
  for (const int k : variables) {
    const FitVariable& v = problem.variables()[k];
    if (observer.note) observer.note("profile of " + v.name);
    const ProfileScale scale = profile_scale(found, k, noise_widening);
    const Profile profile = profile_of(problem, k, t, cost, scale, local_fit);
    if (problem.was_stopped()) return;
    const auto value = [&v](double t_k) { return std::clamp(v.to_parameter(t_k), v.lower, v.upper); };
    const double half = scale.quantile * scale.sigma;
    const double open = std::isfinite(half) ? 0 : kInfinity;
    ParameterProfile& out = result.profiles.emplace_back();
    out.address = v.address;
    out.widening = scale.widening;
    out.quantile = scale.quantile;
    out.sigma = open > 0 ? std::numeric_limits<double>::quiet_NaN() : scale.sigma;
    out.linear_low95 = open > 0 ? v.lower : value(t[k] - half);
    out.linear_high95 = open > 0 ? v.upper : value(t[k] + half);
    out.low95 = profile.low ? value(*profile.low) : v.lower;
    out.high95 = profile.high ? value(*profile.high) : v.upper;
    out.bounded_below = profile.low.has_value();
    out.bounded_above = profile.high.has_value();
    out.forward_runs = profile.forward_runs;
    runs += profile.forward_runs;
    const ProfiledPoint* least = nullptr;
    for (const ProfiledPoint& point : profile.points) {
      ProfilePoint& p = out.points.emplace_back();
      p.value = value(point.t_k);
      p.cost = point.cost;
      p.deviance = deviance(point.cost, cost, scale.widening);
      p.status = point.status;
      p.forward_runs = point.forward_runs;
      const VectorXd values = problem.values(point.t);
      p.values.assign(values.begin(), values.end());
      if (least == nullptr || point.cost < least->cost) least = &point;
    }
    for (const bool is_above : {false, true}) {
      const double bound = is_above ? problem.upper()[k] : problem.lower()[k];
      const std::string sentence = open_side(v, profile, scale, is_above, bound);
      if (!sentence.empty()) result.cannot_tell.push_back(sentence);
    }
    if (cost - least->cost > noticeable(cost, scale.widening))
      out.warning = "the answer is not the optimum: with " + v.name + " held at " +
                    number(value(least->t_k)) + (v.unit.empty() ? "" : " " + v.unit) + " the cost is " +
                    number(cost - least->cost) + " lower. Fit again from there, or from several starts";
    lowest = std::min(lowest, least->cost);
    if (!out.warning.empty() && observer.note) observer.note("warning: " + out.warning);
  }
  result.notes.push_back(
      "Profiles: " + counted(static_cast<long>(variables.size()), "parameter") + " in " +
      counted(runs, "forward run") +
      ". Each was held at values about its best one and the others were fitted again; its 95 % interval is "
      "where "
      "2ΔF/w² stays below q², w and q being those of its reported deviation. Shifts of the discretisation "
      "are not "
      "in it.");
  for (const ParameterProfile& profile : result.profiles)
    if (!profile.warning.empty()) result.notes.push_back("Warning: " + profile.warning + ".");
}

}  // namespace rhytid::fitting
