#include "fitting/discretisation.h"

#include <algorithm>

#include "fitting/difference_shifts.h"
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

/// The clips of the fit with their scenes replaced.
std::vector<OtherFit> finer_fits(const JointFitInput& input) {
  std::vector<OtherFit> fits;
  for (std::size_t c = 0; c < input.clips.size(); ++c) {
    const std::vector<FinerScene> variants = finer_scenes(input.clips[c].scene);
    for (std::size_t r = 0; r < variants.size(); ++r) {
      if (c == 0) {
        const auto& [name, change, scene] = variants[r];
        fits.push_back(
            {name, change, "discretisation: " + change, input, "", {.name = name + " (" + change + ")"}});
        if (!input.evaluations.empty()) fits.back().input.evaluations += "/finer_" + name;
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
  return difference_shifts(finer_fits(input), problem, t, linearised, basis, observer);
}

}  // namespace rhytid::fitting
