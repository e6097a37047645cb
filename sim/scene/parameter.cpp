#include "sim/scene/parameter.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
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
  double reach = 0;  ///< unless 0 the bounds are the value in the scene ± reach
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
    {"/time/offset", 0, 0, none, [](Scene& s, size_t) { return has_motion(s) ? &s.time.offset : nullptr; },
     0.25},
};

/// A kind of parameter that is one component of a vector: the pattern names the vector's rule, addresses have
/// the component's number behind it. The vector is a member of the `count` parts of item i, part k.
struct VectorKind {
  const char* pattern;
  double lower, upper;  ///< `reach` = 0
  double reach;         ///< else the bounds of a component are its value in the scene ± reach
  ParameterTransform transform;
  size_t (*count)(const Scene&, size_t i);
  Vec3* (*member)(Scene&, size_t i, size_t k);
};

const VectorKind vector_kinds[] = {
    // A source at a vertex stays there. Positions are projected to the surface.
    {"/ligaments/sources/*/position", 0, 0, 10, none,
     [](const Scene& s, size_t i) { return size_t{s.ligaments->sources[i].vertex ? 0u : 1u}; },
     [](Scene& s, size_t i, size_t) { return &s.ligaments->sources[i].position; }},
    {"/colliders/*/semi_axes", 0.1, 100, 0, log,
     [](const Scene& s, size_t i) { return size_t{s.colliders[i].shape == ShapeKind::ellipsoid ? 1u : 0u}; },
     [](Scene& s, size_t i, size_t) { return &s.colliders[i].semi_axes; }},
    // A path that is read from a file has no values in the scene.
    {"/colliders/*/path/*/position", 0, 0, 5, none,
     [](const Scene& s, size_t i) {
       return s.colliders[i].path_file.empty() ? s.colliders[i].path.size() : 0;
     },
     [](Scene& s, size_t i, size_t k) { return &s.colliders[i].path[k].position; }},
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

/// A parameter of a scene.
struct Found {
  const char* pattern;  ///< of its rule
  double lower, upper;
  ParameterTransform transform;
  double* value;          ///< in the scene
  std::string address;    ///< by names
  std::string by_number;  ///< the same with items of lists by number
  std::string name;
};

/// The pattern with its first * replaced.
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

void add_components(Scene& scene, const VectorKind& kind, std::vector<Found>& all) {
  const std::vector<std::string> names = item_names(scene, kind.pattern);
  for (size_t i = 0; i < names.size(); ++i)
    for (size_t k = 0; k < kind.count(scene, i); ++k) {
      Vec3& vector = *kind.member(scene, i, k);
      const auto place = [&](const std::string& item) {
        return filled(filled(kind.pattern, item), std::to_string(k));
      };
      const std::string address = place(names[i]), by_number = place(std::to_string(i));
      for (int axis = 0; axis < 3; ++axis) {
        const double value = vector[axis];
        const std::string component = "/" + std::to_string(axis);
        all.push_back({kind.pattern, kind.reach > 0 ? value - kind.reach : kind.lower,
                       kind.reach > 0 ? value + kind.reach : kind.upper, kind.transform, &vector[axis],
                       address + component, by_number + component,
                       short_name(address, true) + " " + "xyz"[axis]});
      }
    }
}

/// All of the scene, in the order of the tables.
std::vector<Found> find_all(Scene& scene) {
  std::vector<Found> all;
  for (const Kind& kind : kinds) {
    const std::vector<std::string> names = item_names(scene, kind.pattern);
    for (size_t i = 0; i < names.size(); ++i) {
      double* value = kind.member(scene, i);
      if (value == nullptr) continue;
      const std::string address = filled(kind.pattern, names[i]);
      all.push_back({kind.pattern, kind.reach > 0 ? *value - kind.reach : kind.lower,
                     kind.reach > 0 ? *value + kind.reach : kind.upper, kind.transform, value, address,
                     filled(kind.pattern, std::to_string(i)), short_name(address, !names[i].empty())});
    }
  }
  for (const VectorKind& kind : vector_kinds) add_components(scene, kind, all);
  return all;
}

/// The same for reading only.
std::vector<Found> find_all(const Scene& scene) {
  return find_all(const_cast<Scene&>(scene));
}

Found find(const Scene& scene, std::string_view address) {
  for (Found& found : find_all(scene))
    if (found.address == address || found.by_number == address) return std::move(found);
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

ParameterSpec describe(const Found& found) {
  const Dimension dimension = find_rule(found.pattern)->dimension;
  return {.address = found.address,
          .name = found.name,
          .unit = unit_text(dimension),
          .dimension = dimension,
          .lower = found.lower,
          .upper = found.upper,
          .transform = found.transform,
          .value = *found.value};
}

}  // namespace

ParameterSpec describe_parameter(const Scene& scene, std::string_view address) {
  return describe(find(scene, address));
}

std::string expected_parameter(const Scene& scene, std::string_view address) {
  const std::string list = "'rhytid check SCENE --parameters' lists them";
  const Rule* rule = rule_at(address);
  const bool is_number = rule != nullptr && rule->type != RuleType::object && rule->type != RuleType::array;
  const auto is_kind = [rule](const Kind& kind) { return rule->pointer == kind.pattern; };
  if (is_number && std::none_of(std::begin(kinds), std::end(kinds), is_kind))
    return "a scalar that can be fitted, which this one is not; " + list;
  bool is_absent = false;  // not in this scene, or 0
  for (const Kind& kind : kinds) {
    const std::vector<std::string> names = item_names(scene, kind.pattern);
    for (size_t i = 0; i < names.size(); ++i)
      if (kind.member(const_cast<Scene&>(scene), i) == nullptr &&
          (address == filled(kind.pattern, names[i]) || address == filled(kind.pattern, std::to_string(i))))
        is_absent = true;
  }
  if (is_absent && address == "/time/offset")
    return "a scene in which a collider or a held part moves, with two knots or more in its path";
  std::vector<std::string> addresses;
  for (const Found& found : find_all(scene)) addresses.push_back(found.address);
  const std::string nearest = nearest_word(address, addresses);
  return nearest.empty() ? "a scene with parameters"
                         : (is_absent ? "a value that this scene has and that is not 0, nearest is "
                                      : "a fit-able scalar, nearest is ") +
                               nearest + "; " + list;
}

std::vector<ParameterSpec> all_parameters(const Scene& scene) {
  std::vector<ParameterSpec> specs;
  for (const Found& found : find_all(scene)) specs.push_back(describe(found));
  return specs;
}

double get_parameter(const Scene& scene, std::string_view address) {
  return *find(scene, address).value;
}

void set_parameter(Scene& scene, std::string_view address, double value) {
  const Found found = find(scene, address);
  const Rule& rule = *find_rule(found.pattern);
  if (!std::isfinite(value) || !is_in_range(rule, value)) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.10g", value);
    const std::string file = scene.file.empty() ? "" : scene.file + ": ";
    throw InputError(file + found.address, text, expectation(rule));
  }
  const double before = std::exchange(*found.value, value);
  for (const Found& still : find_all(scene))
    if (still.value == found.value) return;
  *found.value = before;  // of this kind 0 is no parameter any more
  throw InputError((scene.file.empty() ? "" : scene.file + ": ") + found.address, "0", "a number > 0");
}

}  // namespace rhytid
