#include "fitting/consider.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <set>

#include "fitting/error_posterior.h"
#include "fitting/fit_logs.h"
#include "fitting/path_deviations.h"
#include "fitting/residual_signature.h"
#include "sim/core/error.h"
#include "sim/scene/parameter.h"

namespace rhytid::fitting {
namespace {

bool is_fitted(const JointFitInput& input, const FitParameter& p) {
  return std::any_of(
      input.options.parameters.begin(), input.options.parameters.end(), [&](const FitParameter& other) {
        return other.address == p.address && (other.clip == p.clip || other.clip.empty() || p.clip.empty());
      });
}

/// "off by a factor 1.35", "off by 0.5 mm".
std::string off_by(const FitVariable& v, double sigma) {
  char text[64];
  if (v.transform == ParameterTransform::log)
    std::snprintf(text, sizeof text, "off by a factor %.3g", std::exp(sigma));
  else
    std::snprintf(text, sizeof text, "off by %.3g%s%s", sigma,
                  v.transform == ParameterTransform::none ? " " : " (logit)",
                  v.transform == ParameterTransform::none ? v.unit.c_str() : "");
  return text;
}

/// What a held parameter is off by when its value is off by σ. Of a path whose knots move together: how far, and
/// along which axis ("finger path x").
ResidualAxis axis_of(const FitVariable& v, const std::string& group, double sigma) {
  if (v.moves.empty()) {
    if (v.transform == ParameterTransform::log) return {v.name, "%", 100 * std::expm1(sigma)};
    return {v.name, v.transform == ParameterTransform::none ? v.unit : "(logit)", sigma};
  }
  const std::string& first = v.moves.front().first;
  const std::string knot = first.substr(0, first.rfind('/') + 1);
  Vec3 direction = Vec3::Zero();
  for (const auto& [address, amount] : v.moves)
    if (address.starts_with(knot)) direction[address.back() - '0'] = amount;
  Eigen::Index along = 0;
  const double most = direction.cwiseAbs().maxCoeff(&along);
  const std::string end = " offset";
  const std::string name = group.ends_with(end)
                               ? group.substr(0, group.size() - end.size()) +
                                     (most > 0.999 * direction.norm() ? " " : " mostly ") + "xyz"[along]
                               : v.name;
  return {name, "mm", sigma * direction.norm()};
}

/// More axes than these are one deviation by knot: no offset that could be told.
constexpr std::size_t kMostAxes = 3;

/// Of errors that are told together what matters is Σ δ δᵀ: as many axes as there are parameters say it.
void sum_up(SystematicShift& found) {
  if (found.axes.empty()) return;
  const auto n = static_cast<Eigen::Index>(found.axes.front().size());
  MatrixXd sum = MatrixXd::Zero(n, n);
  for (const std::vector<double>& axis : found.axes) {
    const Eigen::Map<const VectorXd> shift(axis.data(), n);
    sum += shift * shift.transpose();
  }
  set_covariance(sum, found);
}

}  // namespace

std::vector<FitParameter> considered_parameters(const JointFitInput& input) {
  std::vector<FitParameter> list;
  const auto add = [&](const FitParameter& p) {
    const bool is_known = std::any_of(list.begin(), list.end(), [&](const FitParameter& other) {
      return other.address == p.address && other.clip == p.clip;
    });
    if (!is_known && p.prior_sigma != 0. && !is_fitted(input, p)) list.push_back(p);
  };
  for (const FitParameter& p : input.path_errors) add(p);
  if (input.options.consider) {
    for (const FitParameter& p : *input.options.consider) add(p);
    return list;
  }
  struct Held {
    std::string address, clip;
    double value;
  };
  std::vector<Held> held;
  std::set<std::string> apart;  // addresses that are not one parameter of all clips
  for (const FitClip& clip : input.clips)
    for (const ColliderScene& collider : clip.scene.colliders) {
      if (!collider.friction || !(collider.friction->coefficient > 0)) continue;
      const std::string address = "/colliders/" + collider.name + "/friction/coefficient";
      const bool is_fitted_here = std::any_of(
          input.options.parameters.begin(), input.options.parameters.end(), [&](const FitParameter& p) {
            return p.address == address && (p.clip.empty() || p.clip == clip.name);
          });
      for (const Held& other : held)
        if (other.address == address && other.value != collider.friction->coefficient) apart.insert(address);
      if (is_fitted_here)
        apart.insert(address);
      else
        held.push_back({address, clip.name, collider.friction->coefficient});
    }
  for (const Held& h : held) {
    FitParameter p;
    p.address = h.address;
    if (apart.contains(h.address)) p.clip = h.clip;
    p.prior_sigma = kFrictionSigma;
    add(p);
  }
  return list;
}

namespace {

/// What became of held parameters that were looked at in one run.
struct Considered {
  std::vector<SystematicShift> shifts;
  bool failed = false, was_stopped = false;  ///< all of them
};

/// Shifts without a size, one per group and one for each other parameter.
std::vector<SystematicShift> refused(const std::vector<FitParameter>& held, const std::string& why) {
  std::vector<SystematicShift> shifts;
  for (std::size_t h = 0; h < held.size(); ++h) {
    const std::string& group = held[h].group;
    if (!group.empty() && h > 0 && held[h - 1].group == group) continue;
    SystematicShift& shift = shifts.emplace_back();
    shift.name = "held " + (group.empty() ? joint_address(held[h]) : group);
    shift.change = group.empty() ? "held parameter" : group;
    shift.failure = why;
  }
  return shifts;
}

/// The input with these parameters behind its own, at the values that they have at t.
JointFitInput with_held(const JointFitInput& input, const std::vector<FitParameter>& held,
                        const JointProblem& problem, const VectorXd& t) {
  JointFitInput wide = input;
  for (FitParameter p : held) {
    p.prior_sigma.reset();
    p.is_held = true;
    for (int c = 0; c < problem.num_clips() && p.moves.empty(); ++c) {
      // As it was in the fit's run: penalties follow the gauge modulus when that is fitted.
      const Scene scene = problem.clip(c).parametrisation().scene(problem.of_clip(c, t));
      const std::vector<ParameterSpec> known = all_parameters(scene);
      const bool has_it = std::any_of(known.begin(), known.end(),
                                      [&](const ParameterSpec& spec) { return spec.address == p.address; });
      if ((!p.clip.empty() && p.clip != problem.name(c)) || !has_it) continue;
      p.initial = get_parameter(scene, p.address);
      break;
    }
    wide.options.parameters.push_back(std::move(p));
  }
  return wide;
}

Considered consider(const JointFitInput& input, const std::vector<FitParameter>& held, JointProblem& problem,
                    const VectorXd& t, const FitProblem::Linearised& linearised, const MatrixXd& basis,
                    const FitObserver& observer, const std::string& folder) {
  JointFitInput wide = with_held(input, held, problem, t);
  if (std::any_of(held.begin(), held.end(), [](const FitParameter& p) { return !p.moves.empty(); }))
    release_paths(wide);
  if (!wide.evaluations.empty()) wide.evaluations += folder;
  const auto start = std::chrono::steady_clock::now();
  Considered out;
  std::vector<SystematicShift>& shifts = out.shifts;
  const Eigen::Index n = problem.num_parameters();
  try {
    JointProblem considered(wide.clips, wide.options);
    considered.stop_when(observer.should_stop);
    const FitLogs logs(wide, considered, observer.note);
    VectorXd all = considered.initial();
    all.head(n) = t;
    const auto at = considered.linearised(all);
    out.was_stopped = considered.was_stopped();
    if (out.was_stopped) return out;
    const VectorXd &there = considered.evaluate(all).residuals, &here = problem.evaluate(t).residuals;
    const bool is_same_run =
        at && there.size() == here.size() && (there - here).norm() <= 1e-6 * (1 + here.norm());
    out.failed = !is_same_run;
    std::vector<std::vector<Eigen::Index>> columns;  // of each shift
    std::vector<std::vector<ResidualAxis>> axes;
    for (std::size_t h = 0; h < held.size(); ++h) {
      const Eigen::Index column = n + static_cast<Eigen::Index>(h);
      const FitVariable& v = considered.variables()[static_cast<std::size_t>(column)];
      const double sigma = *held[h].prior_sigma;
      const std::string& group = held[h].group;
      if (group.empty() || h == 0 || held[h - 1].group != group) {
        shifts.emplace_back().name = "held " + (group.empty() ? v.name : group);
        shifts.back().change = group.empty() ? v.name + " " + off_by(v, sigma)
                                             : group + ", off by the deviations that it is known to";
        columns.emplace_back(), axes.emplace_back();
      }
      columns.back().push_back(column), axes.back().push_back(axis_of(v, group, sigma));
      SystematicShift& found = shifts.back();
      const double used = v.to_parameter(all[column]);
      if (!at)
        found.failure = considered.last_failure();
      else if (std::fabs(used - v.initial) > 1e-9 * std::max(1e-12, std::fabs(v.initial)))
        found.failure = "the scene's value lies outside the usual bounds of this parameter";
      else if (!is_same_run)
        found.failure =
            "with this parameter on its own the scene is another one (the held modulus, clips that differ)";
      if (!found.failure.empty()) continue;
      const VectorXd shift =
          -sigma *
          (basis * (basis.transpose() * (linearised.jacobian.transpose() * at->jacobian.col(column))));
      if (group.empty())
        found.shift.assign(shift.begin(), shift.end());
      else
        found.axes.emplace_back(shift.begin(), shift.end());
    }
    for (std::size_t g = 0; g < shifts.size(); ++g) {
      if (!shifts[g].failure.empty()) continue;
      MatrixXd moved(at->jacobian.rows(), static_cast<Eigen::Index>(axes[g].size()));
      for (std::size_t k = 0; k < axes[g].size(); ++k)
        moved.col(static_cast<Eigen::Index>(k)) =
            *held[static_cast<std::size_t>(columns[g][k] - n)].prior_sigma * at->jacobian.col(columns[g][k]);
      if (axes[g].size() <= kMostAxes) add_signature(linearised, basis, moved, axes[g], shifts[g]);
      shifts[g].columns = std::move(moved);
      sum_up(shifts[g]);
    }
  } catch (const InputError& error) {
    shifts = refused(held, error.what());
    out.failed = true;
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (SystematicShift& shift : shifts) shift.seconds = seconds / static_cast<double>(shifts.size());
  return out;
}

}  // namespace

std::vector<SystematicShift> considered_shifts(const JointFitInput& input, JointProblem& problem,
                                               const VectorXd& t, const FitProblem::Linearised& linearised,
                                               const MatrixXd& basis, const FitObserver& observer) {
  const std::vector<FitParameter> held = considered_parameters(input);
  if (held.empty() || (observer.should_stop && observer.should_stop())) return {};
  if (observer.note) observer.note("held parameters: by how much they would move the answer");
  Considered found = consider(input, held, problem, t, linearised, basis, observer, "/considered");
  std::vector<FitParameter> paths, others;
  for (const FitParameter& p : held) (p.moves.empty() ? others : paths).push_back(p);
  if (found.was_stopped || !found.failed || paths.empty() || others.empty()) return found.shifts;
  // One kind must not take the other's shifts away.
  found = consider(input, paths, problem, t, linearised, basis, observer, "/considered_paths");
  if (found.was_stopped) return {};
  const Considered second =
      consider(input, others, problem, t, linearised, basis, observer, "/considered_others");
  if (second.was_stopped) return {};
  found.shifts.insert(found.shifts.end(), second.shifts.begin(), second.shifts.end());
  return found.shifts;
}

}  // namespace rhytid::fitting
