#include "tools/scene_argument.h"

#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/located_json.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

/// The part of the case format that leads to its scene; the whole of it is with the fits
/// (fitting/case_rules.h), which the forward program does not have.
const RuleNode& case_rules() {
  static const std::vector<Rule> rules = {
      {.pointer = "", .type = RuleType::object},
      {.pointer = "/scene", .type = RuleType::path},
      {.pointer = "/settings", .type = RuleType::array},
      {.pointer = "/settings/*", .type = RuleType::string},
  };
  static const RuleNode root = build_rule_tree(rules);
  return root;
}

/// Whether the first key of "/key/...=value" is one of scenes.
bool is_of_scenes(const std::string& setting) {
  const std::size_t begin = setting.starts_with('/') ? 1 : 0;
  const std::string key = setting.substr(begin, setting.find_first_of("/=", begin) - begin);
  return scene_rule_tree().child(key) != nullptr;
}

}  // namespace

Scene load_scene_argument(const std::string& file, const std::vector<std::string>& settings,
                          Progress& progress) {
  LocatedJson written = read_with_extends(file, case_rules(), "scene or case");
  if (!written.json.contains("scene") || written.json.contains("skin")) return load_scene(file, settings);
  if (written.json.contains("variants"))
    throw InputError(file, "an experiment", "a scene or a case (rhytid study sweep runs experiments)");

  std::vector<std::string> of_scene;
  for (const std::string& setting : settings)
    if (is_of_scenes(setting)) {
      of_scene.push_back(setting);
    } else {
      apply_override(written, {setting}, file, case_rules());
    }
  const nlohmann::json& scene = written.json["scene"];
  if (!scene.is_string())
    throw InputError(written.where("/scene") + ": /scene", shown_json(scene), "the path of a scene");
  std::vector<Setting> all = settings_at(written, "/settings");
  const std::string path = scene.get<std::string>();
  progress.note(file + " is a case: this is its scene " + path +
                (all.empty() ? "" : ", with " + std::to_string(all.size()) + " of its settings"));
  for (const std::string& setting : of_scene) all.push_back({setting});
  return load_scene(path, all);
}

std::string shown_name(const Scene& scene) {
  return scene.name.empty() ? name_of_file(scene.file) : scene.name;
}

}  // namespace rhytid::tools
