#include "sim/scene/scene_quantity.h"

#include <algorithm>
#include <vector>

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/nearest.h"
#include "sim/scene/rules.h"

namespace rhytid {
namespace {

using nlohmann::json;

/// A number of the scene's JSON.
struct Found {
  SceneQuantity quantity;
  std::string by_number;  ///< its address with items of lists by number: the JSON pointer
};

/// What the keys of an address say, without the lists that its names stand in: "film thickness". Names of items may be
/// those of lists.
std::string short_name(const std::string& address) {
  const std::vector<std::string> keys = split_pointer(address, address);
  std::string name;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    const bool is_list = (k == 0 && (keys[k] == "skin" || keys[k] == "colliders")) ||
                         (k == 1 && (keys[k] == "layers" || keys[k] == "sources"));
    if (!is_list) name += (name.empty() ? "" : " ") + keys[k];
  }
  return name;
}

void collect(const json& value, const RuleNode& node, const std::string& address,
             const std::string& by_number, std::vector<Found>& all) {
  const auto add = [&](const json& number, const std::string& suffix) {
    const std::string at = address + suffix;
    all.push_back({{at, short_name(at), node.rule->dimension, number.get<double>()}, by_number + suffix});
  };
  if (node.rule != nullptr && node.rule->type == RuleType::number) {
    if (value.is_number()) add(value, "");
    return;
  }
  if (node.rule != nullptr &&
      (node.rule->type == RuleType::vector2 || node.rule->type == RuleType::vector3)) {
    for (std::size_t a = 0; a < value.size(); ++a) add(value[a], "/" + std::to_string(a));
    return;
  }
  if (value.is_array()) {
    const RuleNode* item = node.child("*");
    for (std::size_t i = 0; item != nullptr && i < value.size(); ++i) {
      const std::string number = std::to_string(i);
      const std::string name = node.is_named_list() ? escape_key(value[i].value("name", number)) : number;
      collect(value[i], *item, address + "/" + name, by_number + "/" + number, all);
    }
    return;
  }
  for (const RuleEntry& entry : node.children)
    if (const auto found = value.find(entry.key); found != value.end()) {
      const std::string step = "/" + escape_key(entry.key);
      collect(*found, entry.node, address + step, by_number + step, all);
    }
}

/// All numbers of the scene, and the mean thicknesses of layers with a map.
std::vector<Found> find_all(const Scene& scene) {
  std::vector<Found> all;
  collect(scene_to_json(scene), scene_rule_tree(), "", "", all);
  for (std::size_t i = 0; i < scene.skin.layers.size(); ++i) {
    const LayerScene& layer = scene.skin.layers[i];
    if (layer.thickness_map.empty()) continue;
    const std::string address = "/skin/layers/" + escape_key(layer.name) + "/thickness";
    const SceneQuantity mean{address, short_name(address), dimension::length, layer.thickness};
    all.push_back({mean, "/skin/layers/" + std::to_string(i) + "/thickness"});
  }
  return all;
}

Found find(const Scene& scene, std::string_view address) {
  for (Found& found : find_all(scene))
    if (found.quantity.address == address || found.by_number == address) return std::move(found);
  throw InputError((scene.file.empty() ? "" : scene.file + ": ") + "address",
                   shown_json(std::string(address)), expected_quantity(scene, address));
}

/// The layer whose thickness an address means, when it has a map; else null.
LayerScene* mapped_layer(Scene& scene, const Found& found) {
  for (LayerScene& layer : scene.skin.layers)
    if (!layer.thickness_map.empty() &&
        found.quantity.address == "/skin/layers/" + escape_key(layer.name) + "/thickness")
      return &layer;
  return nullptr;
}

}  // namespace

SceneQuantity describe_quantity(const Scene& scene, std::string_view address) {
  return find(scene, address).quantity;
}

std::string expected_quantity(const Scene& scene, std::string_view address) {
  std::vector<std::string> known;
  for (const Found& found : find_all(scene)) known.push_back(found.quantity.address);
  return "a number of the scene, nearest is " + nearest_word(address, known);
}

Scene with_quantity(const Scene& scene, std::string_view address, double value) {
  const Found found = find(scene, address);
  Scene moved = scene;
  if (LayerScene* layer = mapped_layer(moved, found)) {
    // The file stays what it is, so the scene's JSON could not say it.
    if (!(value > 0)) {
      const std::string file = scene.file.empty() ? "" : scene.file + ": ";
      throw InputError(file + found.quantity.address, std::to_string(value) + " mm", "a mean thickness > 0");
    }
    for (double& thickness : layer->thickness_by_vertex) thickness *= value / layer->thickness;
    layer->thickness = value;
    return moved;
  }
  json written = scene_to_json(scene);
  written.at(json::json_pointer(found.by_number)) = value;
  moved = parse_scene(written, scene.file);
  // Maps that were scaled before are no longer what their files say.
  for (std::size_t i = 0; i < scene.skin.layers.size(); ++i) {
    moved.skin.layers[i].thickness_by_vertex = scene.skin.layers[i].thickness_by_vertex;
    if (!scene.skin.layers[i].thickness_map.empty())
      moved.skin.layers[i].thickness = scene.skin.layers[i].thickness;
  }
  return moved;
}

}  // namespace rhytid
