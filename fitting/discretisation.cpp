#include "fitting/discretisation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <utility>

#include "fitting/fit_logs.h"
#include "sim/core/error.h"
#include "sim/scene/skin_rule.h"

namespace rhytid::fitting {
namespace {

constexpr int kHighestOrder = 4;

/// The product rule of the scene, full or not, with explicit numbers of points where they are enough for the orders; the
/// default one in place of a prism rule.
void set_product_rule(SkinScene& skin, int triangle_degree, int thickness_points) {
  if (skin.rule == RuleKind::sheet) skin.rule = RuleKind::product;
  skin.prism_degree = 0;
  skin.triangle_degree = triangle_degree;
  skin.thickness_points = thickness_points;
  const std::vector<SkinRuleCheck> checks = check_skin_rules(skin);
  if (std::any_of(checks.begin(), checks.end(), [](const SkinRuleCheck& c) { return c.sees_too_little(); }))
    skin.triangle_degree = skin.thickness_points = 0;
}

FinerScene finer_thickness(const Scene& scene) {
  FinerScene finer{"thickness", {}, scene};
  SkinScene& skin = finer.scene.skin;
  std::string orders;
  const bool is_composite = skin.scheme == ThicknessScheme::composite;
  skin.scheme = ThicknessScheme::stacked;
  for (LayerScene& layer : skin.layers) {
    if (is_composite) {
      layer.elements = 1;
      layer.order = std::max(layer.order, skin.composite_order);
    } else if (layer.order < kHighestOrder) {
      ++layer.order;
    } else {
      layer.elements *= 2;
    }
    orders += (orders.empty() ? "" : " and ") + std::to_string(layer.order);
  }
  set_product_rule(skin, scene.skin.triangle_degree, 0);
  finer.change = (is_composite ? "layers stacked with orders " : "orders through the layers ") + orders +
                 (is_composite ? " instead of one element" : " or elements halved");
  return finer;
}

FinerScene finer_plane(const Scene& scene) {
  FinerScene finer{"plane", {}, scene};
  SkinScene& skin = finer.scene.skin;
  skin.order += skin.order < kHighestOrder ? 1 : -1;
  set_product_rule(skin, 0, scene.skin.thickness_points);
  finer.change =
      "order " + std::to_string(skin.order) + " in the plane instead of " + std::to_string(scene.skin.order);
  return finer;
}

FinerScene finer_steps(const Scene& scene) {
  FinerScene finer{"steps", {}, scene};
  finer.scene.time.substeps *= 2;
  finer.change = std::to_string(finer.scene.time.substeps) + " steps per frame instead of " +
                 std::to_string(scene.time.substeps);
  return finer;
}

/// Whitened change of the residuals of one clip, rows as in its linearisation; tracks that only one of both
/// could attach stay as they are.
void add_change(const FitProblem& clip, const FitEvaluation& at, const FitProblem& finer,
                const FitEvaluation& finer_at, Eigen::Index row, VectorXd& change, double& squares,
                int& count) {
  std::map<std::pair<int, int>, std::size_t> of_finer;  // camera and track
  for (std::size_t i = 0; i < finer.compared().size(); ++i)
    of_finer[{finer.compared()[i].camera, finer.compared()[i].track}] = i;
  for (std::size_t i = 0; i < clip.compared().size(); ++i) {
    const TrackNoise& noise = clip.noise()[i];
    const auto same = of_finer.find({clip.compared()[i].camera, clip.compared()[i].track});
    if (same != of_finer.end() && finer.compared()[same->second].frames == clip.compared()[i].frames) {
      const VectorXd difference = finer_at.differences[same->second] - at.differences[i];
      change.segment(row, noise.num_rows()) =
          noise.weighted_residual(finer_at.differences[same->second], at.tracks[i]) -
          noise.weighted_residual(at.differences[i], at.tracks[i]);
      squares += difference.squaredNorm();
      count += static_cast<int>(difference.size()) / 2;
    }
    row += noise.num_rows();
  }
  change.segment(row, at.measured.size()) = finer_at.measured - at.measured;
}

/// The clips of the fit with their scenes replaced.
struct FinerFit {
  std::string name, change;
  JointFitInput input;
};

std::vector<FinerFit> finer_fits(const JointFitInput& input) {
  std::vector<FinerFit> fits;
  for (std::size_t c = 0; c < input.clips.size(); ++c) {
    const std::vector<FinerScene> variants = finer_scenes(input.clips[c].scene);
    for (std::size_t r = 0; r < variants.size(); ++r) {
      if (c == 0) {
        fits.push_back({variants[r].name, variants[r].change, input});
        if (!input.evaluations.empty()) fits.back().input.evaluations += "/finer_" + variants[r].name;
      }
      fits[r].input.clips[c].scene = variants[r].scene;
    }
  }
  return fits;
}

}  // namespace

std::vector<FinerScene> finer_scenes(const Scene& scene) {
  return {finer_thickness(scene), finer_plane(scene), finer_steps(scene)};
}

std::vector<SystematicShift> discretisation_shifts(const JointFitInput& input, JointProblem& problem,
                                                   const VectorXd& t,
                                                   const FitProblem::Linearised& linearised,
                                                   const MatrixXd& basis, const FitObserver& observer) {
  std::vector<SystematicShift> shifts;
  for (const FinerFit& fit : finer_fits(input)) {
    if (observer.should_stop && observer.should_stop()) return {};
    if (observer.note) observer.note("discretisation: " + fit.change);
    SystematicShift& found = shifts.emplace_back();
    found.name = fit.name, found.change = fit.change;
    const auto start = std::chrono::steady_clock::now();
    try {
      JointProblem finer(fit.input.clips, fit.input.options);
      finer.stop_when(observer.should_stop);
      const FitLogs logs(fit.input, finer, observer.note);
      const ObjectiveEvaluation& evaluation = finer.evaluate(t);
      if (finer.was_stopped()) return {};
      if (evaluation.failed) {
        found.failure = evaluation.failure;
        continue;
      }
      VectorXd change = VectorXd::Zero(linearised.residuals.size());
      double squares = 0;
      int count = 0;
      Eigen::Index row = 0;
      for (int c = 0; c < problem.num_clips(); ++c) {
        const VectorXd own = problem.of_clip(c, t);
        add_change(problem.clip(c), problem.clip(c).evaluate(own), finer.clip(c), finer.clip(c).evaluate(own),
                   row, change, squares, count);
        row += problem.clip(c).num_residuals();
      }
      const VectorXd shift = -basis * (basis.transpose() * (linearised.jacobian.transpose() * change));
      found.shift.assign(shift.begin(), shift.end());
      found.rms_px = std::sqrt(squares / std::max(1, count));
    } catch (const InputError& error) {
      found.failure = error.what();
    }
    found.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  return shifts;
}

}  // namespace rhytid::fitting
