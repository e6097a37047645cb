#include "sim/scene/load.h"

#include <algorithm>
#include <numbers>

#include "sim/core/error.h"
#include "sim/scene/collider_motion.h"
#include "sim/scene/fields.h"
#include "sim/scene/located_json.h"
#include "sim/scene/names.h"
#include "sim/scene/read_path.h"
#include "sim/scene/skin_rule.h"
#include "sim/scene/validate.h"
#include "sim/scene/vertex_values.h"
#include "sim/solve/minimise.h"

namespace rhytid {
namespace {

using nlohmann::json;

/// Millimetres per unit of the words that /skin/surface/unit may hold.
double mm_per(const std::string& unit) {
  if (unit == "cm") return 10;
  if (unit == "m") return 1000;
  return unit == "in" ? 25.4 : 1;
}

/// Archive (fields.h) that fills structs from validated JSON with all defaults in place.
class Reader {
 public:
  explicit Reader(const json& source) : source_(source) {}

  bool has(const char* key, bool) const { return source_.contains(key); }

  template <class T>
  void operator()(const char* key, T& member) {
    if (source_.contains(key)) read(source_.at(key), member);
  }
  template <class F>
  void group(const char* key, bool, F f) {
    if (!source_.contains(key)) return;
    Reader inner(source_.at(key));
    f(inner);
  }
  void flag(const char* key, const char* word, const char*, bool& member) {
    member = source_.at(key) == word;
  }
  void scale(const char* key, const char* unit_key, double& member) {
    if (source_.contains(unit_key)) member = mm_per(source_.at(unit_key));
    if (source_.contains(key)) member = source_.at(key).get<double>();
  }

 private:
  static void read(const json& value, double& member) { member = value.get<double>(); }
  static void read(const json& value, int& member) { member = value.get<int>(); }
  static void read(const json& value, bool& member) { member = value.get<bool>(); }
  static void read(const json& value, std::string& member) { member = value.get<std::string>(); }
  static void read(const json& value, Vec3& member) {
    for (int i = 0; i < 3; ++i) member[i] = value.at(static_cast<size_t>(i)).get<double>();
  }
  template <class T, size_t n>
  static void read(const json& value, std::array<T, n>& member) {
    member = value.get<std::array<T, n>>();
  }
  template <class T>
  static void read(const json& value, std::optional<T>& member) {
    read(value, member.emplace());
  }
  template <class T>
  static void read(const json& value, std::vector<T>& member) {
    member.clear();
    for (const json& item : value) read(item, member.emplace_back());
  }
  template <class T>
  static void read(const json& value, T& member) {
    if constexpr (std::is_enum_v<T>) {
      const auto& words = EnumNames<T>::words;
      const auto found = std::find(words.begin(), words.end(), value.get_ref<const std::string&>());
      member = static_cast<T>(found - words.begin());
    } else {
      Reader inner(value);
      fields(inner, member);
    }
  }

  const json& source_;
};

/// Archive (fields.h) that writes structs to JSON.
class Writer {
 public:
  bool has(const char*, bool is_present) const { return is_present; }

  template <class T>
  void operator()(const char* key, const T& member) {
    if constexpr (requires { member.has_value(); }) {
      if (member) target_[key] = written(*member);
    } else {
      target_[key] = written(member);
    }
  }
  template <class F>
  void group(const char* key, bool is_present, F f) {
    if (!is_present) return;
    Writer inner;
    f(inner);
    target_[key] = std::move(inner.target_);
  }
  void flag(const char* key, const char* yes, const char* no, bool member) {
    target_[key] = member ? yes : no;
  }
  void scale(const char* key, const char*, double member) {
    if (member > 0) target_[key] = member;
  }

  const json& result() const { return target_; }

 private:
  template <class T>
  static json written(const std::vector<T>& list) {
    json items = json::array();
    for (const T& item : list) items.push_back(written(item));
    return items;
  }
  static json written(const Vec3& v) { return {v[0], v[1], v[2]}; }
  template <class T>
  static json written(const T& member) {
    if constexpr (std::is_enum_v<T>) {
      return to_string(member);
    } else if constexpr (std::is_constructible_v<json, T>) {
      return member;
    } else {
      Writer inner;
      fields(inner, member);
      return inner.target_;
    }
  }

  json target_ = json::object();
};

/// Reads the files with values per vertex that the scene mentions.
void read_vertex_files(Scene& scene, const LocatedJson& resolved) {
  const auto read = [&resolved](const std::string& path, const std::string& pointer) {
    return read_vertex_values(path, resolved.where(pointer) + ": " + pointer);
  };
  for (size_t i = 0; i < scene.skin.layers.size(); ++i) {
    LayerScene& layer = scene.skin.layers[i];
    if (layer.thickness_map.empty()) continue;
    layer.thickness_by_vertex =
        read(layer.thickness_map, "/skin/layers/" + std::to_string(i) + "/thickness_map");
    layer.thickness = mean_of_given(layer.thickness_by_vertex);
  }
  if (scene.ligaments && !scene.ligaments->map.empty())
    scene.ligaments->b_by_vertex = read(scene.ligaments->map, "/ligaments/map");
}

/// Refuses turns whose direction is anybody's guess, and splines through too many knots.
void check_motion(const ColliderScene& collider, const std::string& file) {
  const std::string at = (file.empty() ? "" : file + ": ") + "/colliders/" + collider.name;
  const std::size_t knots = collider.path.size();
  if (collider.interpolation != PathKind::linear && knots > KnotPath::max_spline_knots)
    throw InputError(at + "/interpolation", "a spline through " + std::to_string(knots) + " knots",
                     "at most " + std::to_string(KnotPath::max_spline_knots) + ", or linear");
  for (std::size_t k = 1; k < knots; ++k) {
    const PathKnot &before = collider.path[k - 1], &knot = collider.path[k];
    // Numbers beyond half a turn are meant as they stand: 0 to 300 degrees would turn by −60. Orientations
    // from a file are never written so; from 179 to −179 degrees is a turn by 2.
    const bool is_meant = std::max(before.rotation.norm(), knot.rotation.norm()) > 1.0001 * std::numbers::pi;
    const double written = is_meant ? (knot.rotation - before.rotation).norm() : 0;
    const double degrees = std::max(angle_between(before, knot), written) * 180 / std::numbers::pi;
    if (degrees > 170)
      throw InputError(at + "/path/" + std::to_string(k) + "/rotation",
                       "a turn by " + std::to_string(degrees) + " deg from the knot before",
                       "at most 170 deg; put a knot between");
  }
}

/// Refuses rules that leave an element deformations without energy.
void check_quadrature(const SkinScene& skin, const LocatedJson& resolved) {
  for (const SkinRuleCheck& check : check_skin_rules(skin)) {
    if (!check.sees_too_little()) continue;
    std::string at = "/skin/quadrature";
    if (skin.rule == RuleKind::sheet)
      at += "/rule";
    else if (skin.prism_degree > 0)
      at += "/prism_degree";
    const std::string element =
        (check.layer.empty() ? "the composite element" : "an element of layer " + check.layer) +
        " (p = " + std::to_string(skin.order) + ", q = " + std::to_string(check.order) + ")";
    throw InputError(resolved.where(at) + ": " + at,
                     std::to_string(check.points) + " points, so " + std::to_string(6 * check.points) +
                         " strains, for the " + std::to_string(check.ways) + " ways to deform of " + element +
                         ", which leaves some without energy",
                     "a lower order through the thickness, or the default product rule");
  }
}

/// The scene as the rules read it. `lbfgs_literal` stands for the publication's values of what is not given.
LocatedJson resolve_scene(LocatedJson scene) {
  if (scene.json.is_object() && scene.json.value("solver", json()).is_object() &&
      scene.json["solver"].value("minimiser", json()) == name(Minimiser::lbfgs_literal)) {
    const MinimiserOptions published = published_minimiser();
    json solver = {{"relative_tolerance", published.relative_tolerance},
                   {"absolute_tolerance", published.absolute_tolerance},
                   {"lbfgs_memory", published.lbfgs_memory},
                   {"lbfgs_refresh", published.lbfgs_refresh}};
    solver.update(scene.json["solver"]);
    scene.json["solver"] = std::move(solver);
  }
  LocatedJson resolved = resolve_against_rules(scene);
  check_consistency(resolved);
  return resolved;
}

Scene to_scene(LocatedJson located, const std::string& file) {
  const LocatedJson resolved = resolve_scene(std::move(located));
  Scene scene;
  Reader reader(resolved.json);
  fields(reader, scene);
  scene.file = file;
  check_quadrature(scene.skin, resolved);
  read_vertex_files(scene, resolved);
  for (ColliderScene& collider : scene.colliders) {
    if (!collider.path_file.empty()) collider.path = read_path(collider.path_file);
    check_motion(collider, file);
  }
  return scene;
}

LocatedJson load_located(const std::string& path, std::span<const Setting> settings) {
  LocatedJson scene = read_with_extends(path);
  for (const Setting& setting : settings) apply_override(scene, setting, path);
  return scene;
}

LocatedJson without_lines(const json& value, const std::string& file) {
  LocatedJson located{.json = value, .origin = {}};
  if (!file.empty()) located.origin[""] = file;
  return located;
}

}  // namespace

json load_scene_json(const std::string& path, const std::vector<std::string>& overrides) {
  return load_located(path, of_command_line(overrides)).json;
}

Scene parse_scene(const json& value, const std::string& file) {
  return to_scene(without_lines(value, file), file);
}

Scene parse_scene_text(std::string_view text, const std::string& file,
                       const std::vector<std::string>& overrides) {
  // Merging into an empty object removes nulls, as reading from a file does.
  LocatedJson own = parse_located(text, file);
  LocatedJson scene;
  scene.json = json::object();
  merge(scene, own);
  scene.origin[""] = own.where("");
  for (const std::string& assignment : overrides) apply_override(scene, {assignment}, file);
  return to_scene(scene, file);
}

Scene load_scene(const std::string& path, const std::vector<std::string>& overrides) {
  return load_scene(path, of_command_line(overrides));
}

Scene load_scene(const std::string& path, std::span<const Setting> settings) {
  return to_scene(load_located(path, settings), path);
}

json scene_with_defaults(const json& value) {
  return resolve_scene(without_lines(value, "")).json;
}

json scene_to_json(const Scene& scene) {
  Writer writer;
  fields(writer, scene);
  return writer.result();
}

}  // namespace rhytid
