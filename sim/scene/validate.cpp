#include "sim/scene/validate.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "sim/core/error.h"
#include "sim/scene/names.h"
#include "sim/scene/nearest.h"
#include "sim/scene/rules.h"

namespace rhytid {
namespace {

using nlohmann::json;

/// Where a value stands: by numbers, to look up its origin; by names, to be read and used in --set.
struct Place {
  std::string pointer, shown;

  Place key(const std::string& key) const {
    return {pointer + "/" + escape_key(key), shown + "/" + shown_text(escape_key(key))};
  }
  Place item(size_t index, const std::string& name) const {
    const std::string number = std::to_string(index);
    return {pointer + "/" + number, shown + "/" + (name.empty() ? number : escape_key(name))};
  }
};

bool is_name(const std::string& text) {
  if (text.empty() || text.size() > 200) return false;
  const bool has_bad = std::any_of(text.begin(), text.end(), [](unsigned char c) {
    return c < 0x20 || c == 0x7f || c == '/' || c == '~' || c == '=';
  });
  return !has_bad && !std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// Name of a list item for messages, or "".
std::string item_name(const json& item) {
  if (!item.is_object() || !item.contains("name") || !item["name"].is_string()) return "";
  const std::string name = item["name"];
  return is_name(name) ? name : "";
}

class Resolver {
 public:
  explicit Resolver(const LocatedJson& scene) : scene_(scene) {}

  json resolve(const RuleNode& node, const json& value, const Place& place) const {
    const Rule& rule = *node.rule;
    switch (rule.type) {
      case RuleType::object:
        return object(node, value, place);
      case RuleType::array:
        return array(node, value, place);
      case RuleType::number:
        return number(rule, value, place);
      case RuleType::quantity:
        if (!value.is_number() && !value.is_string()) refuse(rule, value, place);
        if (value.is_string()) parse_quantity(value.get_ref<const std::string&>(), where(place));
        return value;
      case RuleType::integer:
        return integer(rule, value, place);
      case RuleType::boolean:
        if (!value.is_boolean()) refuse(rule, value, place);
        return value;
      case RuleType::option:
        if (!value.is_string() || std::find(rule.options.begin(), rule.options.end(),
                                            value.get<std::string>()) == rule.options.end())
          refuse(rule, value, place);
        return value;
      case RuleType::name:
        if (!value.is_string() || !is_name(value.get_ref<const std::string&>())) refuse(rule, value, place);
        return value;
      case RuleType::path:
        if (!value.is_string() || value.get_ref<const std::string&>().empty()) refuse(rule, value, place);
        return value;
      case RuleType::string:
        if (!value.is_string()) refuse(rule, value, place);
        return value;
      case RuleType::vector2:
      case RuleType::vector3:
        return vector(rule, value, place);
      case RuleType::integers2:
        return vector(rule, value, place);
    }
    return value;
  }

 private:
  std::string where(const Place& place) const {
    const std::string origin = scene_.where(place.pointer);
    const std::string shown = place.shown.empty() ? "/" : place.shown;
    return origin.empty() ? shown : origin + ": " + shown;
  }

  [[noreturn]] void refuse(const Rule& rule, const json& value, const Place& place) const {
    throw InputError(where(place), shown_json(value), expectation(rule));
  }

  json object(const RuleNode& node, const json& value, const Place& place) const {
    if (!value.is_object()) refuse(*node.rule, value, place);
    for (const auto& [key, item] : value.items())
      if (node.child(key) == nullptr) refuse_key(node, key, place);
    json result = json::object();
    for (const auto& [key, child] : node.children) {
      const Rule& rule = *child.rule;
      const bool is_given = value.contains(key);
      const bool rival_given = !rule.rival.empty() && value.contains(rule.rival);
      if (is_given && rival_given)
        throw InputError(where(place.key(key)), "both \"" + key + "\" and \"" + rule.rival + "\"",
                         "one of the two");
      if (!is_given && !rival_given && rule.needs_one_of_pair)
        throw InputError(where(place), "neither \"" + key + "\" nor \"" + rule.rival + "\"",
                         "one of the two" + (rule.type == RuleType::path
                                                 ? ", e.g. --set " + place.shown + "/" + key + "=PATH"
                                                 : std::string()));
      const bool has_meaning = rule.needs.empty() || value.contains(rule.needs);
      if (is_given && !has_meaning)
        throw InputError(where(place.key(key)), shown_json(value[key]),
                         "nothing, since it only has a meaning together with \"" + rule.needs + "\"");
      if (is_given)
        result[key] = resolve(child, value[key], place.key(key));
      else if (rule.is_required)
        throw InputError(where(place.key(key)), "nothing", expectation(rule) + " (required)");
      else if (!rule.fallback.is_null() && has_meaning && !rival_given)
        result[key] = resolve(child, rule.fallback, place.key(key));
    }
    return result;
  }

  [[noreturn]] void refuse_key(const RuleNode& node, const std::string& key, const Place& place) const {
    if (place.pointer.empty() && key == "extends")
      throw InputError(where(place.key(key)), "extends", "a scene that has been read from its file");
    std::vector<std::string> known;
    for (const auto& child : node.children) known.push_back(child.key);
    throw InputError(where(place.key(key)), "the unknown key " + shown_json(key),
                     "a known key, nearest is \"" + nearest_word(key, known) + "\"");
  }

  json array(const RuleNode& node, const json& value, const Place& place) const {
    const Rule& rule = *node.rule;
    if (!value.is_array()) refuse(rule, value, place);
    if (!is_in_range(rule, static_cast<double>(value.size()))) refuse(rule, value, place);
    const RuleNode& item = *node.child("*");
    json result = json::array();
    for (size_t i = 0; i < value.size(); ++i)
      result.push_back(
          resolve(item, value[i], place.item(i, node.is_named_list() ? item_name(value[i]) : "")));
    return result;
  }

  double number(const Rule& rule, const json& value, const Place& place) const {
    double result = 0;
    if (value.is_number())
      result = value.get<double>();
    else if (value.is_string())
      result = parse_quantity(value.get_ref<const std::string&>(), rule.dimension, where(place));
    else
      refuse(rule, value, place);
    if (!std::isfinite(result) || !is_in_range(rule, result)) refuse(rule, value, place);
    return result;
  }

  /// Any rule on an integer has bounds that fit an int, or none; without bounds int's own range holds.
  int integer(const Rule& rule, const json& value, const Place& place) const {
    if (!value.is_number()) refuse(rule, value, place);
    const double number = value.get<double>();
    if (number != std::floor(number) || std::abs(number) > 2147483647.0 || !is_in_range(rule, number))
      refuse(rule, value, place);
    return static_cast<int>(number);
  }

  json vector(const Rule& rule, const json& value, const Place& place) const {
    const size_t size = rule.type == RuleType::vector3 ? 3 : 2;
    if (!value.is_array() || value.size() != size) refuse(rule, value, place);
    json result = json::array();
    for (size_t i = 0; i < size; ++i) {
      const Place at = place.item(i, "");
      if (rule.type == RuleType::integers2)
        result.push_back(integer(rule, value[i], at));
      else
        result.push_back(number(rule, value[i], at));
    }
    return result;
  }

  const LocatedJson& scene_;
};

void require_unique_names(const LocatedJson& scene, const json& list, const std::string& pointer) {
  std::set<std::string> seen;
  for (size_t i = 0; i < list.size(); ++i)
    if (!seen.insert(list[i]["name"].get<std::string>()).second) {
      const std::string at = pointer + "/" + std::to_string(i) + "/name";
      throw InputError(scene.where(at) + ": " + at, shown_json(list[i]["name"]) + " a second time",
                       "a name of its own for each item");
    }
}

void require_direction(const LocatedJson& scene, const json& holder, const std::string& pointer,
                       const std::string& key) {
  const json& normal = holder[key];
  double largest = 0;
  for (const json& component : normal) largest = std::max(largest, std::abs(component.get<double>()));
  // Beyond these sizes the squared length would leave the range of a double.
  if (largest < 1e-100 || largest > 1e100)
    throw InputError(scene.where(pointer + "/" + key) + ": " + pointer + "/" + key, shown_json(normal),
                     "a vector that is not zero");
}

void require_box(const LocatedJson& scene, const json& box, const std::string& at, bool may_be_flat) {
  for (size_t axis = 0; axis < 3; ++axis) {
    const double low = box["low"][axis], high = box["high"][axis];
    if (low > high || (low == high && !may_be_flat))
      throw InputError(scene.where(at) + ": " + at,
                       shown_json(box["low"]) + " and " + shown_json(box["high"]),
                       "low below high in every coordinate");
  }
}

void check_crop(const LocatedJson& scene) {
  const std::string at = "/skin/surface/crop";
  const json& surface = scene.json["skin"]["surface"];
  if (!surface.contains("crop")) return;
  const json& crop = surface["crop"];
  std::string given;
  int count = 0;
  for (const char* key : {"centre", "box", "vertices", "vertices_file"})
    if (crop.contains(key)) given += (count++ ? ", \"" : "\"") + std::string(key) + "\"";
  if (count != 1)
    throw InputError(scene.where(at) + ": " + at, count == 0 ? "none of them" : given,
                     "exactly one of \"centre\", \"box\", \"vertices\" and \"vertices_file\"");
  if (crop.contains("box")) require_box(scene, crop["box"], at + "/box", false);
}

/// Knots of a path in the order of time. `at` by number, `shown` by name.
void require_increasing_times(const LocatedJson& scene, const json& moved, const std::string& at,
                              const std::string& shown) {
  const json& path = moved["path"];
  for (size_t k = 1; k < path.size(); ++k)
    if (path[k]["time"].get<double>() <= path[k - 1]["time"].get<double>()) {
      const std::string number = "/path/" + std::to_string(k) + "/time";
      throw InputError(
          scene.where(at + number) + ": " + shown + number, shown_json(path[k]["time"]),
          "a time later than that of the knot before, " + shown_json(path[k - 1]["time"]) + " s");
    }
}

/// A value per vertex of the file says nothing of the vertices that subdivision makes.
void check_subdivision(const LocatedJson& scene) {
  const json& root = scene.json;
  const json& surface = root["skin"]["surface"];
  if (!surface.contains("subdivide") || surface["subdivide"] == 0) return;
  const auto refuse = [&scene](const std::string& at) {
    throw InputError(scene.where(at) + ": " + at, "values per vertex of a surface that is subdivided",
                     "no /skin/surface/subdivide, or a constant");
  };
  for (size_t i = 0; i < root["skin"]["layers"].size(); ++i)
    if (root["skin"]["layers"][i].contains("thickness_map"))
      refuse("/skin/layers/" + std::to_string(i) + "/thickness_map");
  if (root.contains("ligaments") && root["ligaments"].contains("map")) refuse("/ligaments/map");
}

void check_held(const LocatedJson& scene) {
  const json& skin = scene.json["skin"];
  if (!skin.contains("held")) return;
  require_unique_names(scene, skin["held"], "/skin/held");
  for (size_t i = 0; i < skin["held"].size(); ++i) {
    const json& held = skin["held"][i];
    const std::string at = "/skin/held/" + std::to_string(i);
    require_box(scene, held["box"], at + "/box", true);
    if (held.contains("path"))
      require_increasing_times(scene, held, at, "/skin/held/" + escape_key(held["name"].get<std::string>()));
  }
}

/// Quadrature keys that exclude each other, the direction of a pre-stretch.
void check_skin(const LocatedJson& scene) {
  const json& root = scene.json;
  const json& quadrature = root["skin"]["quadrature"];
  const bool is_sheet = quadrature["rule"] == "sheet";
  if (quadrature["rule"] == "full" && quadrature["prism_degree"].get<int>() > 0) {
    const std::string at = "/skin/quadrature/prism_degree";
    throw InputError(scene.where(at) + ": " + at, "both it and the full rule", "one of the two");
  }
  if (is_sheet || quadrature["prism_degree"].get<int>() > 0) {
    const char* const prism = is_sheet ? "the sheet rule" : "prism_degree";
    for (const char* key : {"triangle_degree", "thickness_points", "prism_degree"})
      if (quadrature[key].get<int>() > 0 && (is_sheet || std::string(key) != "prism_degree")) {
        const std::string at = std::string("/skin/quadrature/") + key;
        throw InputError(scene.where(at) + ": " + at, std::string("both it and ") + prism, "one of the two");
      }
    if (quadrature["volume"] == "reduced")
      throw InputError(scene.where("/skin/quadrature/volume") + ": /skin/quadrature/volume",
                       std::string("\"reduced\" with ") + prism, "\"full\", or a product rule");
  }
  if (quadrature["volume"] == "reduced" && quadrature["thickness_points"] == 1)
    throw InputError(scene.where("/skin/quadrature/thickness_points") + ": /skin/quadrature/thickness_points",
                     "1 with a reduced volume", "2 or more");
  if (root["skin"].contains("pre_stretch") && root["skin"]["pre_stretch"].contains("direction"))
    require_direction(scene, root["skin"]["pre_stretch"], "/skin/pre_stretch", "direction");
}

/// Positive, and no flatter than the nearest point to a place can be found for (sim/surface/shapes.h).
void require_semi_axes(const LocatedJson& scene, const json& semi_axes, const std::string& pointer) {
  double smallest = semi_axes[0], largest = smallest;
  for (const json& length : semi_axes) {
    smallest = std::min(smallest, length.get<double>());
    largest = std::max(largest, length.get<double>());
  }
  if (smallest <= 0 || largest > 1000 * smallest)
    throw InputError(scene.where(pointer) + ": " + pointer, shown_json(semi_axes),
                     "three lengths > 0 mm, the longest at most 1000 times the shortest");
}

/// A pass has the lag of the pass before, so that there is nothing to extrapolate.
void check_lag(const LocatedJson& scene) {
  const json& time = scene.json["time"];
  if (time["lag"] != to_string(FrictionLag::extrapolated) || time["lag_passes"] == 1) return;
  throw InputError(scene.where("/time/lag_passes") + ": /time/lag_passes", shown_json(time["lag_passes"]),
                   "1, since /time/lag is extrapolated: later passes would have a lag of their own");
}

}  // namespace

LocatedJson resolve_against_rules(const LocatedJson& scene, const RuleNode& rules) {
  const Resolver resolver(scene);
  return {.json = resolver.resolve(rules, scene.json, Place{}), .origin = scene.origin};
}

void check_consistency(const LocatedJson& scene) {
  const json& root = scene.json;
  require_unique_names(scene, root["skin"]["layers"], "/skin/layers");
  check_crop(scene);
  if (root.contains("ligaments") && root["ligaments"].contains("sources"))
    require_unique_names(scene, root["ligaments"]["sources"], "/ligaments/sources");
  require_unique_names(scene, root["colliders"], "/colliders");

  check_skin(scene);
  check_held(scene);
  check_subdivision(scene);
  check_lag(scene);
  if (root.contains("base")) {
    const json& base = root["base"];
    require_direction(scene, base, "/base", "normal");
    if (base["shape"] == "sphere" && base["radius"].get<double>() <= 0)
      throw InputError(scene.where("/base/radius") + ": /base/radius", shown_json(base["radius"]),
                       "a length > 0 mm, since the base is a sphere");
    if (base.contains("points") && base["shape"] != "imls")
      throw InputError(scene.where("/base/points") + ": /base/points", shown_json(base["points"]),
                       "nothing, since only the shape imls has points");
  }
  for (size_t i = 0; i < root["colliders"].size(); ++i) {
    const json& collider = root["colliders"][i];
    const std::string at = "/colliders/" + std::to_string(i);
    require_direction(scene, collider, at, "normal");
    require_direction(scene, collider, at, "axis");
    if (collider["shape"] == "ellipsoid") require_semi_axes(scene, collider["semi_axes"], at + "/semi_axes");
    if (!collider.contains("path")) continue;
    require_increasing_times(scene, collider, at,
                             "/colliders/" + escape_key(collider["name"].get<std::string>()));
  }
}

}  // namespace rhytid
