#include "sim/scene/parameter.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <functional>
#include <utility>

#include "sim/core/error.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/located_json.h"
#include "sim/scene/nearest.h"
#include "sim/scene/rules.h"

namespace rhytid {
namespace {

/// A kind of parameter. `member` is null when item i of this scene does not have it (no friction, a plane's
/// radius; a fraction or coefficient of zero leaves its physics out, so that no derivative would see it); i
/// is the index for the * of the pattern and unused without one.
struct Kind {
  const char* pattern;
  double lower, upper;
  ParameterTransform transform;
  double* (*member)(Scene&, size_t i);
};

using enum ParameterTransform;

/// A value of zero has no logarithm to be fitted by.
double* of_positive(double& value) {
  return value > 0 ? &value : nullptr;
}

// Bounds are wide physical ranges of skin; a fit usually narrows them.
const Kind kinds[] = {
    {"/skin/layers/*/youngs_modulus", 1e-4, 1e3, log,
     [](Scene& s, size_t i) { return &s.skin.layers[i].youngs_modulus; }},
    {"/skin/layers/*/poissons_ratio", 0, 0.4999, logit,
     [](Scene& s, size_t i) { return &s.skin.layers[i].poissons_ratio; }},
    {"/skin/layers/*/stiffening", 0.25, 100, log,
     [](Scene& s, size_t i) { return of_positive(s.skin.layers[i].stiffening); }},
    {"/skin/layers/*/relaxing_fraction", 1e-3, 0.999, logit,
     [](Scene& s, size_t i) {
       double& fraction = s.skin.layers[i].relaxing_fraction;
       return fraction > 0 && s.time.damper != DamperScheme::none ? &fraction : nullptr;
     }},
    {"/skin/layers/*/relaxation_time", 1e-3, 1e2, log,
     [](Scene& s, size_t i) { return &s.skin.layers[i].relaxation_time; }},
    {"/skin/pre_stretch/stretch", 0.5, 2, log,
     [](Scene& s, size_t) { return s.skin.pre_stretch ? &s.skin.pre_stretch->stretch : nullptr; }},
    {"/skin/pre_stretch/across", 0.5, 2, log,
     [](Scene& s, size_t) {
       return s.skin.pre_stretch && s.skin.pre_stretch->across ? &*s.skin.pre_stretch->across : nullptr;
     }},
    {"/ligaments/stiffness", 1e-7, 1, log,
     [](Scene& s, size_t) { return s.ligaments ? &s.ligaments->stiffness : nullptr; }},
    {"/ligaments/diffusion_time", 1e-2, 1e5, log,
     [](Scene& s, size_t) {
       return s.ligaments && s.ligaments->map.empty() ? &s.ligaments->diffusion_time : nullptr;
     }},
    {"/ligaments/map_scale", 1e-3, 1e3, log,
     [](Scene& s, size_t) {
       return s.ligaments && !s.ligaments->map.empty() ? &s.ligaments->map_scale : nullptr;
     }},
    {"/ligaments/sources/*/strength", 1e-3, 1e2, log,
     [](Scene& s, size_t i) { return of_positive(s.ligaments->sources[i].strength); }},
    {"/base/stiffness", 1e-3, 1e3, log,
     [](Scene& s, size_t) { return s.base ? &s.base->stiffness : nullptr; }},
    {"/colliders/*/radius", 0.1, 100, log,
     [](Scene& s, size_t i) {
       return collider_radius(s.colliders[i]) > 0 ? &s.colliders[i].radius : nullptr;
     }},
    {"/colliders/*/stiffness", 1e-3, 1e3, log, [](Scene& s, size_t i) { return &s.colliders[i].stiffness; }},
    {"/colliders/*/friction/coefficient", 1e-3, 5, log,
     [](Scene& s, size_t i) {
       auto& friction = s.colliders[i].friction;
       return friction && friction->coefficient > 0 ? &friction->coefficient : nullptr;
     }},
};

/// Names of the items that the * of a pattern runs over; a pattern without * has one nameless item.
std::vector<std::string> item_names(const Scene& scene, std::string_view pattern) {
  std::vector<std::string> names;
  const auto collect = [&names](const auto& items) {
    for (const auto& item : items) names.push_back(item.name);
  };
  if (pattern.find('*') == std::string_view::npos)
    names.emplace_back();
  else if (pattern.starts_with("/skin/layers/"))
    collect(scene.skin.layers);
  else if (pattern.starts_with("/colliders/"))
    collect(scene.colliders);
  else if (scene.ligaments)
    collect(scene.ligaments->sources);
  return names;
}

struct Found {
  const Kind* kind = nullptr;
  size_t item = 0;
  std::string address;  ///< by names
  std::string name;
};

std::string filled(std::string pattern, const std::string& item) {
  const size_t star = pattern.find('*');
  return star == std::string::npos ? pattern : pattern.replace(star, 1, escape_key(item));
}

/// "film youngs_modulus", "ligaments stiffness", "finger friction coefficient".
std::string short_name(const std::string& address, bool has_item) {
  const std::vector<std::string> keys = split_pointer(address, address);
  size_t first = 0;
  if (has_item) first = keys[0] == "colliders" ? 1 : 2;
  std::string name;
  for (size_t i = first; i < keys.size(); ++i) name += (name.empty() ? "" : " ") + keys[i];
  return name;
}

/// The members are only read through the returned pointers when the scene is const.
std::vector<Found> find_all(const Scene& scene) {
  std::vector<Found> all;
  for (const Kind& kind : kinds) {
    const std::vector<std::string> names = item_names(scene, kind.pattern);
    for (size_t i = 0; i < names.size(); ++i) {
      if (kind.member(const_cast<Scene&>(scene), i) == nullptr) continue;
      const std::string address = filled(kind.pattern, names[i]);
      all.push_back({&kind, i, address, short_name(address, !names[i].empty())});
    }
  }
  return all;
}

Found find(const Scene& scene, std::string_view address) {
  for (const Found& found : find_all(scene))
    if (found.address == address || filled(found.kind->pattern, std::to_string(found.item)) == address)
      return found;
  const std::string file = scene.file.empty() ? "" : scene.file + ": ";
  throw InputError(file + "parameter address", shown_json(std::string(address)),
                   expected_parameter(scene, address));
}

/// The rule of what an address points to, items of lists by whatever name; null when no scene has it.
const Rule* rule_at(std::string_view address) {
  if (!address.starts_with('/')) return nullptr;
  const RuleNode* node = &scene_rule_tree();
  for (const std::string& key : split_pointer(address, "")) {
    const RuleNode* item = node->child("*");
    node = item != nullptr ? item : node->child(key);
    if (node == nullptr) return nullptr;
  }
  return node->rule;
}

ParameterSpec describe(const Scene& scene, const Found& found) {
  const Dimension dimension = find_rule(found.kind->pattern)->dimension;
  return {.address = found.address,
          .name = found.name,
          .unit = unit_text(dimension),
          .dimension = dimension,
          .lower = found.kind->lower,
          .upper = found.kind->upper,
          .transform = found.kind->transform,
          .value = *found.kind->member(const_cast<Scene&>(scene), found.item)};
}

}  // namespace

ParameterSpec describe_parameter(const Scene& scene, std::string_view address) {
  return describe(scene, find(scene, address));
}

std::string expected_parameter(const Scene& scene, std::string_view address) {
  const std::string list = "'rhytid check SCENE --parameters' lists them";
  const Rule* rule = rule_at(address);
  const bool is_number = rule != nullptr && rule->type != RuleType::object && rule->type != RuleType::array;
  const auto is_kind = [rule](const Kind& kind) { return rule->pointer == kind.pattern; };
  if (is_number && std::none_of(std::begin(kinds), std::end(kinds), is_kind))
    return "a scalar that can be fitted, which this one is not; " + list;
  for (const Kind& kind : kinds) {
    const std::vector<std::string> names = item_names(scene, kind.pattern);
    for (size_t i = 0; i < names.size(); ++i)
      if (kind.member(const_cast<Scene&>(scene), i) == nullptr &&
          (address == filled(kind.pattern, names[i]) || address == filled(kind.pattern, std::to_string(i))))
        return "a value that this scene has and that is not 0; " + list;
  }
  std::vector<std::string> addresses;
  for (const Found& found : find_all(scene)) addresses.push_back(found.address);
  const std::string nearest = nearest_word(address, addresses);
  return nearest.empty() ? "a scene with parameters"
                         : "a fit-able scalar, nearest is " + nearest + "; " + list;
}

std::vector<ParameterSpec> all_parameters(const Scene& scene) {
  std::vector<ParameterSpec> specs;
  for (const Found& found : find_all(scene)) specs.push_back(describe(scene, found));
  return specs;
}

double get_parameter(const Scene& scene, std::string_view address) {
  const Found found = find(scene, address);
  return *found.kind->member(const_cast<Scene&>(scene), found.item);
}

void set_parameter(Scene& scene, std::string_view address, double value) {
  const Found found = find(scene, address);
  const Rule& rule = *find_rule(found.kind->pattern);
  if (!std::isfinite(value) || !is_in_range(rule, value)) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.10g", value);
    const std::string file = scene.file.empty() ? "" : scene.file + ": ";
    throw InputError(file + found.address, text, expectation(rule));
  }
  double& member = *found.kind->member(scene, found.item);
  const double before = std::exchange(member, value);
  if (found.kind->member(scene, found.item) != nullptr) return;
  member = before;  // of this kind 0 is no parameter any more
  throw InputError((scene.file.empty() ? "" : scene.file + ": ") + found.address, "0", "a number > 0");
}

}  // namespace rhytid
