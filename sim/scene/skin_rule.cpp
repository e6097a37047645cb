#include "sim/scene/skin_rule.h"

#include <algorithm>

namespace rhytid {
namespace {

/// Total degree of the prism rule, 0 = a product rule.
int prism_degree(const SkinScene& skin) {
  constexpr int kSheetDegrees[] = {1, 4, 5, 6};  // by p
  return skin.rule == RuleKind::sheet ? kSheetDegrees[skin.order - 1] : skin.prism_degree;
}
int triangle_degree(const SkinScene& skin) {
  if (skin.triangle_degree > 0) return skin.triangle_degree;
  return 2 * skin.order + (skin.rule == RuleKind::full ? 2 : 0);
}
int thickness_points(const SkinScene& skin, int order) {
  if (skin.thickness_points > 0) return skin.thickness_points;
  if (skin.rule == RuleKind::full || skin.volume == VolumeQuadrature::reduced) return order + 1;
  return std::max(2, order);
}

}  // namespace

PrismRule skin_rule(const SkinScene& skin, int order, int fewer) {
  if (const int degree = prism_degree(skin); degree > 0) return prism_rule(degree);
  return tensor_rule(triangle_rule(triangle_degree(skin)),
                     std::max(1, thickness_points(skin, order) - fewer));
}

std::vector<SkinRuleCheck> check_skin_rules(const SkinScene& skin) {
  const bool is_composite = skin.scheme == ThicknessScheme::composite;
  std::vector<SkinRuleCheck> checks;
  for (const LayerScene& layer : skin.layers) {
    SkinRuleCheck check;
    check.layer = is_composite ? "" : layer.name;
    check.order = is_composite ? skin.composite_order : layer.order;
    check.plane_needed = 2 * (skin.order - 1);
    check.thickness_needed = std::max(2, 2 * check.order - 1);
    const PrismRule rule = skin_rule(skin, check.order);
    const int slabs = is_composite ? static_cast<int>(skin.layers.size()) : 1;
    check.points = slabs * static_cast<int>(rule.points.size());
    check.ways = 3 * (skin.order + 1) * (skin.order + 2) / 2 * (check.order + 1) - 6;
    if (const int degree = prism_degree(skin); degree > 0) {
      check.plane = rule.degree;
      check.thickness = std::max(rule.degree, 3);  // the rule of degree 1 has two Gauss points through it
    } else {
      check.plane = triangle_rule(triangle_degree(skin)).degree;
      check.thickness = 2 * thickness_points(skin, check.order) - 1;
    }
    checks.push_back(std::move(check));
    if (is_composite) break;
  }
  return checks;
}

}  // namespace rhytid
