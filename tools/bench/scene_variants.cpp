#include "tools/bench/scene_variants.h"

#include "sim/scene/load.h"

namespace rhytid::tools {
namespace {

using nlohmann::json;

/// Moves what lies under the first collider at first as that one moves.
void hold_instead(const json& collider, json& scene) {
  constexpr double half = 3;  // mm
  const json& path = collider.at("path");
  const json& first = path.at(0).at("position");
  json knots = json::array();
  for (const json& knot : path) {
    json displacement = json::array();
    for (std::size_t k = 0; k < 3; ++k)
      displacement.push_back(knot.at("position").at(k).get<double>() - first.at(k).get<double>());
    knots.push_back({{"time", knot.at("time")}, {"displacement", displacement}});
  }
  json low = json::array(), high = json::array();
  for (std::size_t k = 0; k < 3; ++k) {
    const double at = first.at(k).get<double>(), reach = k == 2 ? 1000 : half;
    low.push_back(at - reach);
    high.push_back(at + reach);
  }
  scene["skin"]["held"] = json::array(
      {{{"name", "in place of a collider"}, {"box", {{"low", low}, {"high", high}}}, {"path", knots}}});
}

}  // namespace

std::vector<SceneVariant> scene_variants(const Scene& scene) {
  const json full = scene_to_json(scene);
  std::vector<SceneVariant> variants;
  const auto add = [&](const std::string& name, const json& changed, VariantOutput output = {}) {
    if (!variants.empty() && changed == full && !output.files && !output.states) return;
    variants.push_back({name, parse_scene(changed, scene.file), output});
  };
  const auto without = [&](const std::string& name, const auto& change) {
    json changed = full;
    change(changed);
    add(name, changed);
  };
  add("all features", full);
  without("without viscosity", [](json& s) { s["time"]["damper"] = "none"; });
  without("without ligaments", [](json& s) { s.erase("ligaments"); });
  without("without bone base", [](json& s) { s.erase("base"); });
  without("without friction", [](json& s) {
    if (s.contains("colliders"))
      for (json& collider : s["colliders"]) collider.erase("friction");
  });
  without("without contact", [](json& s) {
    if (!s.contains("colliders") || s["colliders"].empty()) return;
    if (!s["skin"].contains("held") || s["skin"]["held"].empty()) hold_instead(s["colliders"][0], s);
    s.erase("colliders");
  });
  without("without second layer", [](json& s) {
    json& layers = s["skin"]["layers"];
    while (layers.size() > 1) layers.erase(layers.size() - 1);
  });
  without("without Fung's factor (C = 0)", [](json& s) {
    for (json& layer : s["skin"]["layers"]) layer["stiffening"] = 0;
  });
  if (scene.skin.pre_stretch)
    without("without pre-stretch", [](json& s) { s["skin"].erase("pre_stretch"); });
  else
    without("with pre-stretch 1.05", [](json& s) { s["skin"]["pre_stretch"] = {{"stretch", 1.05}}; });
  if (scene.skin.rule == RuleKind::product && scene.skin.prism_degree == 0)
    without("with the full quadrature", [](json& s) { s["skin"]["quadrature"]["rule"] = "full"; });
  without("with reduced volume rule", [](json& s) { s["skin"]["quadrature"]["volume"] = "reduced"; });
  if (scene.time.substeps > 1)
    without("without substeps", [](json& s) { s["time"]["substeps"] = 1; });
  else
    without("with 2 substeps", [](json& s) { s["time"]["substeps"] = 2; });
  add("with files and pictures", full, {.files = true});
  add("with states kept", full, {.states = true});
  add("with states and histories kept", full, {.states = true, .histories = true});
  return variants;
}

}  // namespace rhytid::tools
