#include "fitting/case.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "fitting/case_rules.h"
#include "sim/core/error.h"
#include "sim/core/units.h"
#include "sim/scene/load.h"
#include "sim/scene/located_json.h"
#include "sim/scene/names.h"
#include "sim/scene/nearest.h"
#include "sim/scene/validate.h"

namespace rhytid::fitting {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

RenderCase read_render(const json& j) {
  RenderCase c;
  c.width = j["width"], c.height = j["height"], c.supersampling = j["supersampling"];
  c.noise = j["noise"], c.seed = j["seed"], c.texture_scale = j["texture_scale"];
  c.codec = j["codec"], c.finger = j["finger"], c.tilt = j["tilt"], c.truth_spacing = j["truth_spacing"];
  return c;
}

TrackCase read_track(const json& j) {
  TrackCase c;
  c.max_tracks = j["max_tracks"], c.min_distance = j["min_distance"], c.mask_finger = j["mask_finger"];
  c.model = j["model"], c.window = j["window"];
  if (j.contains("roi")) c.roi = j["roi"].get<std::array<double, 4>>();
  return c;
}

FitCase read_fit(const json& j) {
  FitCase c;
  c.optimiser = j["optimiser"], c.max_evaluations = j["max_evaluations"];
  c.robust_scale = j["robust_scale"], c.min_sigma = j["min_sigma"];
  c.first_frame = j["first_frame"], c.last_frame = j["last_frame"];
  c.rim_margin = j["rim_margin"], c.gauge_layer = j["gauge_layer"];
  return c;
}

/// Reads the parts of a case that mean something only together with its scene.
class ParameterReader {
 public:
  ParameterReader(const LocatedJson& located, const Scene& scene) : located_(located), scene_(scene) {}

  FitParameter read(std::size_t index) {
    const json& item = located_.json["fit"]["parameters"][index];
    pointer_ = "/fit/parameters/" + std::to_string(index);
    const ParameterSpec spec = described(item["address"].get<std::string>());
    if (!seen_.insert(spec.address).second)
      throw InputError(where("address"), shown_text(spec.address) + " a second time", "each parameter once");
    FitParameter p;
    p.address = spec.address;
    p.lower = quantity(item, "lower", spec), p.upper = quantity(item, "upper", spec);
    p.initial = quantity(item, "initial", spec);
    if (item.contains("prior_sigma")) p.prior_sigma = item["prior_sigma"].get<double>();
    if (item.contains("transform")) {
      const std::string word = item["transform"];
      const auto& words = EnumNames<ParameterTransform>::words;
      p.transform =
          static_cast<ParameterTransform>(std::find(words.begin(), words.end(), word) - words.begin());
    }
    check(p, spec, item);
    return p;
  }

 private:
  std::string where(const std::string& key) const {
    const std::string pointer = pointer_ + "/" + key;
    return located_.where(pointer) + ": " + pointer;
  }

  ParameterSpec described(const std::string& address) const {
    std::vector<std::string> known;
    for (const ParameterSpec& spec : all_parameters(scene_)) known.push_back(spec.address);
    try {
      return describe_parameter(scene_, address);
    } catch (const InputError&) {
      throw InputError(where("address"), shown_json(address),
                       "in " + scene_.file + " " + expected_parameter(scene_, address));
    }
  }

  std::optional<double> quantity(const json& item, const std::string& key, const ParameterSpec& spec) const {
    if (!item.contains(key)) return std::nullopt;
    if (item[key].is_number()) return item[key].get<double>();
    return parse_quantity(item[key].get_ref<const std::string&>(), spec.dimension, where(key));
  }

  /// lower < initial < upper, inside what a scene may hold, and positive where a logarithm is taken.
  void check(const FitParameter& p, const ParameterSpec& spec, const json& item) const {
    const double lower = p.lower.value_or(spec.lower), upper = p.upper.value_or(spec.upper);
    for (const auto& [key, value] :
         {std::pair{"lower", p.lower}, std::pair{"upper", p.upper}, std::pair{"initial", p.initial}}) {
      if (!value) continue;
      Scene trial = scene_;
      try {
        set_parameter(trial, p.address, *value);
      } catch (const InputError& error) {
        throw InputError(where(key) + ": " + error.what());
      }
    }
    const auto text = [&spec](double value) { return format_quantity(value, spec.dimension, 6); };
    const std::string bound = p.lower ? "lower" : "upper";
    if (!(lower < upper))
      throw InputError(where(bound), shown_json(item.value(bound, json())),
                       "lower < upper, which are " + text(lower) + " and " + text(upper));
    const double initial = p.initial.value_or(spec.value);
    if (!(lower <= initial && initial <= upper))
      throw InputError(where("initial"), text(initial) + (p.initial ? "" : " (the scene's value)"),
                       "a value from " + text(lower) + " to " + text(upper));
    const ParameterTransform transform = p.transform.value_or(spec.transform);
    if (transform == ParameterTransform::log && !(lower > 0))
      throw InputError(where("lower"), text(lower), "a value > 0, since the transform is log");
    if (transform == ParameterTransform::logit && (initial == lower || initial == upper))
      throw InputError(where("initial"), text(initial),
                       "a value strictly between the bounds, since the transform is logit");
  }

  const LocatedJson& located_;
  const Scene& scene_;
  std::string pointer_;
  std::set<std::string> seen_;
};

/// "/settings/N" behind the settings that a case has.
std::string setting_address(const LocatedJson& written) {
  const json settings = written.json.value("settings", json::array());
  return "/settings/" + std::to_string(settings.is_array() ? settings.size() : 0);
}

void check_gauge_layer(const LocatedJson& located, const Scene& scene, const std::string& layer) {
  if (layer.empty()) return;
  std::vector<std::string> names;
  for (const LayerScene& l : scene.skin.layers) names.push_back(l.name);
  if (std::find(names.begin(), names.end(), layer) != names.end()) return;
  throw InputError(located.where("/fit/gauge_layer") + ": /fit/gauge_layer", shown_json(layer),
                   "a layer of " + scene.file + ", nearest is \"" + nearest_word(layer, names) + "\"");
}

std::string find_or_in_folder(const std::string& given, const std::string& case_file,
                              const std::string& fallback, const std::string& folder) {
  if (given.empty()) return (fs::path(folder) / fallback).string();
  const fs::path path(given);
  const fs::path beside = path.is_absolute() ? path : fs::path(case_file).parent_path() / path;
  std::error_code ignored;
  if (fs::exists(beside, ignored)) return beside.lexically_normal().string();
  return (fs::path(folder) / path.filename()).string();
}

/// A scene where a case is wanted, and values of the scene addressed as if they were the case's: said here,
/// since as unknown keys they would only be compared with the keys of cases.
void refuse_scene(const LocatedJson& written, const std::string& path,
                  const std::vector<std::string>& settings) {
  if (written.json.contains("skin") && !written.json.contains("scene"))
    throw InputError(path, "a scene",
                     "a case, which names its scene (an example: data/scenes/demo/case.json)");
  for (const std::string& setting : settings) {
    const std::vector<std::string> keys =
        split_pointer(std::string_view(setting).substr(0, setting.find('=')), "--set");
    if (keys.empty() || case_rule_tree().child(keys[0]) || !scene_rule_tree().child(keys[0])) continue;
    throw InputError("--set " + shown_json(setting), "a value of the scene",
                     "one of the case; this changes its scene: --set " +
                         shown_json(setting_address(written) + "=" + setting));
  }
}

/// The scene of the fit. What its messages say to set is set through the case.
Scene scene_of_fit(const Case& c, const LocatedJson& written) {
  try {
    return load_scene(c.scene, c.scene_settings);
  } catch (const InputError& error) {
    std::string text = error.what();
    const std::string advice = "e.g. --set /";
    if (const std::size_t at = text.find(advice); at != std::string::npos)
      text.insert(at + advice.size() - 1, setting_address(written) + "=");
    throw InputError(text);
  }
}

}  // namespace

Case load_case(const std::string& path, const std::vector<std::string>& settings) {
  LocatedJson written = read_with_extends(path, case_rule_tree(), "case");
  refuse_scene(written, path, settings);
  for (const std::string& assignment : settings)
    apply_override(written, {assignment}, path, case_rule_tree());
  const LocatedJson located = resolve_against_rules(written, case_rule_tree());
  const json& root = located.json;

  Case c;
  c.file = path, c.name = root["name"];
  c.scene = root["scene"], c.scene_settings = settings_at(located, "/settings");
  if (root.contains("truth")) {
    const json& truth = root["truth"];
    const bool has_scene = truth.contains("scene");
    c.truth_scene = has_scene ? truth["scene"].get<std::string>() : c.scene;
    if (!has_scene) c.truth_settings = c.scene_settings;
    for (const Setting& setting : settings_at(located, "/truth/settings"))
      c.truth_settings.push_back(setting);
  }
  c.camera = root.value("camera", "");
  c.footage = root["footage"], c.tracks = root["tracks"];
  c.render = read_render(root["render"]);
  c.track = read_track(root["track"]);
  if (c.track.roi && ((*c.track.roi)[2] < 1 || (*c.track.roi)[3] < 1))
    throw InputError(located.where("/track/roi") + ": /track/roi", shown_json(root["track"]["roi"]),
                     "x, y, width and height with a width and a height of at least 1 px");
  if (c.track.window % 2 == 0)
    throw InputError(located.where("/track/window") + ": /track/window", std::to_string(c.track.window),
                     "an odd number of px, so that the window has a middle");
  c.fit = read_fit(root["fit"]);
  if (c.fit.last_frame != 0 && c.fit.last_frame < c.fit.first_frame)
    throw InputError(located.where("/fit/last_frame") + ": /fit/last_frame", std::to_string(c.fit.last_frame),
                     "0 (all frames) or at least first_frame, " + std::to_string(c.fit.first_frame));

  const Scene scene = scene_of_fit(c, written);
  if (c.name.empty()) c.name = scene.name.empty() ? fs::path(path).stem().string() : scene.name;
  ParameterReader reader(located, scene);
  for (std::size_t i = 0; i < root["fit"]["parameters"].size(); ++i)
    c.fit.parameters.push_back(reader.read(i));
  check_gauge_layer(located, scene, c.fit.gauge_layer);
  return c;
}

std::string footage_path(const Case& c, const std::string& folder) {
  return find_or_in_folder(c.footage, c.file, c.render.codec == "h264" ? "footage.mp4" : "footage.avi",
                           folder);
}

std::string tracks_path(const Case& c, const std::string& folder) {
  return find_or_in_folder(c.tracks, c.file, "tracks.csv", folder);
}

std::string camera_path(const Case& c, const std::string& folder) {
  return c.camera.empty() ? (fs::path(folder) / "camera.yaml").string() : c.camera;
}

}  // namespace rhytid::fitting
