// What the clips of a case mean: scenes, addresses, and each view as a case of its own.
#include <algorithm>
#include <filesystem>

#include "fitting/case.h"
#include "fitting/joint_problem.h"
#include "sim/core/error.h"
#include "sim/scene/load.h"
#include "sim/scene/nearest.h"
#include "sim/scene/scene_quantity.h"

namespace rhytid::fitting {

namespace fs = std::filesystem;

std::vector<Scene> scenes_of(const Case& c) {
  if (c.clips.empty()) return {load_scene(c.scene, c.scene_settings)};
  std::vector<Scene> scenes;
  for (const ClipCase& clip : c.clips) {
    try {
      scenes.push_back(load_scene(clip.scene, clip.scene_settings));
    } catch (const InputError& error) {
      throw InputError("clip '" + clip.name + "': " + error.what());
    }
  }
  return scenes;
}

std::vector<Scene> scenes_of_stage(const Case& c, const StageCase& stage) {
  Case coarse = c;
  const auto add = [&stage](std::vector<Setting>& settings) {
    settings.insert(settings.end(), stage.settings.begin(), stage.settings.end());
  };
  add(coarse.scene_settings);
  for (ClipCase& clip : coarse.clips) add(clip.scene_settings);
  return scenes_of(coarse);
}

std::string StageCase::words() const {
  std::string text;
  for (const Setting& setting : settings) text += (text.empty() ? "" : ", ") + setting.text;
  if (last_frame > 0)
    text += (text.empty() ? "" : ", ") + std::string("frames to ") + std::to_string(last_frame);
  return text.empty() ? "the scene as it is" : text;
}

std::vector<FitParameter> parameters_named(const Case& c, const std::vector<Scene>& scenes,
                                           const std::string& address, const std::string& where) {
  const auto described = [&](const Scene& scene, const std::string& at) {
    try {
      return describe_parameter(scene, at);
    } catch (const InputError&) {
      throw InputError(where, shown_json(address), "in " + scene.file + " " + expected_parameter(scene, at));
    }
  };
  const auto has = [](const Scene& scene, const std::string& at) {
    try {
      describe_parameter(scene, at);
      return true;
    } catch (const InputError&) {
      return false;
    }
  };
  const auto parameter = [](const std::string& at, const std::string& clip) {
    FitParameter p;
    p.address = at;
    p.clip = clip;
    return p;
  };
  const std::string prefix = "/clips/";
  if (!address.starts_with(prefix)) {
    for (const Scene& scene : scenes)
      if (has(scene, address)) return {parameter(described(scene, address).address, "")};
    described(scenes[0], address);  // throws
  }
  const std::size_t end = std::min(address.find('/', prefix.size()), address.size());
  const std::string name = address.substr(prefix.size(), end - prefix.size()), rest = address.substr(end);
  std::vector<std::string> names;
  std::vector<FitParameter> found;
  for (std::size_t k = 0; k < c.clips.size(); ++k) {
    names.push_back(c.clips[k].name);
    if (name == names.back() || (name == "*" && has(scenes[k], rest)))
      found.push_back(parameter(described(scenes[k], rest).address, names.back()));
  }
  if (!found.empty()) return found;
  if (names.empty())
    throw InputError(where, shown_json(address), "an address into the scene: the case has no clips");
  if (name == "*") described(scenes[0], rest);  // throws
  throw InputError(where, shown_json(address),
                   "a clip of the case, nearest is \"" + nearest_word(name, names) + "\"");
}

namespace {

/// The address by names of a number of the scene or of a collider's path. Throws InputError.
std::string quantity_address(const Scene& scene, const std::string& address) {
  for (std::size_t i = 0; i < scene.colliders.size(); ++i) {
    const std::string by_name = "/colliders/" + escape_key(scene.colliders[i].name) + "/path";
    if (scene.colliders[i].path.empty()) continue;
    if (address == by_name || address == "/colliders/" + std::to_string(i) + "/path") return by_name;
  }
  return describe_quantity(scene, address).address;
}

}  // namespace

std::vector<ConsideredQuantity> quantities_named(const Case& c, const std::vector<Scene>& scenes,
                                                 const std::string& address, const std::string& where) {
  const std::string prefix = "/clips/";
  const bool is_of_clip = address.starts_with(prefix);
  const std::size_t end = is_of_clip ? std::min(address.find('/', prefix.size()), address.size()) : 0;
  const std::string name = is_of_clip ? address.substr(prefix.size(), end - prefix.size()) : "";
  const std::string rest = address.substr(end);
  std::vector<ConsideredQuantity> found;
  std::string expected;
  for (std::size_t k = 0; k < scenes.size(); ++k) {
    const std::string clip = k < c.clips.size() ? c.clips[k].name : "";
    if (is_of_clip && name != "*" && name != clip) continue;
    try {
      const std::string by_name = quantity_address(scenes[k], rest);
      if (is_of_clip || found.empty()) found.push_back({.address = by_name, .clip = is_of_clip ? clip : ""});
    } catch (const InputError&) {
      if (expected.empty()) expected = expected_quantity(scenes[k], rest);
    }
  }
  if (!found.empty()) return found;
  throw InputError(where, shown_json(address), expected.empty() ? "a clip of the case" : expected);
}

std::vector<std::string> fitted_named(const Case& c, const std::vector<Scene>& scenes,
                                      const std::vector<FitParameter>& fitted, const std::string& address,
                                      const std::string& where) {
  if (address == "all") return {address};
  std::vector<std::string> found;
  std::string known;
  for (const FitParameter& p : fitted) known += ", " + joint_address(p);
  for (const FitParameter& named : parameters_named(c, scenes, address, where))
    for (const FitParameter& p : fitted)
      if (joint_address(p) == joint_address(named)) found.push_back(joint_address(p));
  if (found.empty()) throw InputError(where, shown_json(address), "all, or what is fitted" + known);
  return found;
}

Case case_of_view(const Case& c, int clip, int view) {
  if (c.clips.empty()) return c;
  const ClipCase& k = c.clips[clip];
  Case one = c;
  one.clips.clear();
  one.scene = k.scene, one.scene_settings = k.scene_settings;
  one.truth_scene = k.truth_scene, one.truth_settings = k.truth_settings;
  one.measurements = k.measurements;
  const ViewCase& seen = k.views[view];
  one.camera = seen.camera, one.camera_image = seen.camera_image, one.camera_unit = seen.camera_unit;
  one.view_pointer = seen.pointer, one.footage = seen.footage, one.tracks = seen.tracks;
  return one;
}

std::string folder_of_view(const Case& c, int clip, int view, const std::string& folder) {
  if (c.clips.empty()) return folder;
  const fs::path of_clip = fs::path(folder) / c.clips[clip].name;
  const std::string& name = c.clips[clip].views[view].name;
  return (name.empty() ? of_clip : of_clip / name).string();
}

std::pair<int, int> view_named(const Case& c, const std::string& name) {
  std::string all;
  for (std::size_t k = 0; k < c.clips.size(); ++k)
    for (std::size_t v = 0; v < c.clips[k].views.size(); ++v) {
      const std::string& view = c.clips[k].views[v].name;
      const std::string full = c.clips[k].name + (view.empty() ? "" : "/" + view);
      if (name == full) return {static_cast<int>(k), static_cast<int>(v)};
      all += (all.empty() ? "" : ", ") + full;
    }
  throw InputError("--clip", name.empty() ? "none" : shown_text(name),
                   c.clips.empty() ? "no such option: the case has no clips" : "one of " + all);
}

}  // namespace rhytid::fitting
