#include "fitting/case.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <tuple>

#include "fitting/case_consider.h"
#include "fitting/case_rules.h"
#include "fitting/colmap.h"
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
  c.codec = j["codec"], c.finger = j["finger"], c.finger_dots = j["finger_dots"], c.tilt = j["tilt"],
  c.truth_spacing = j["truth_spacing"];
  return c;
}

TrackCase read_track(const json& j) {
  TrackCase c;
  c.max_tracks = j["max_tracks"], c.min_distance = j["min_distance"], c.mask_finger = j["mask_finger"];
  c.model = j["model"], c.window = j["window"], c.redetect = j["redetect"];
  if (j.contains("exposure")) c.exposure = j["exposure"].get<double>();
  if (j.contains("roi")) c.roi = j["roi"].get<std::array<double, 4>>();
  return c;
}

FitCase read_fit(const json& j) {
  FitCase c;
  c.optimiser = j["optimiser"], c.max_evaluations = j["max_evaluations"];
  c.robust_scale = j["robust_scale"], c.min_sigma = j["min_sigma"];
  c.first_frame = j["first_frame"], c.last_frame = j["last_frame"];
  c.rim_margin = j["rim_margin"], c.gauge_layer = j["gauge_layer"];
  c.discretisation_check = j["discretisation_check"], c.path_deviations = j["path_deviations"];
  if (j.contains("wrinkles")) {
    const json& w = j["wrinkles"];
    WrinkleLine line;
    for (int a = 0; a < 3; ++a) line.line.from[a] = w["from"][a], line.line.to[a] = w["to"][a];
    line.points = w["points"];
    line.band.shortest = w["shortest"];
    if (w.contains("longest")) line.band.longest = w["longest"];
    c.wrinkles = line;
  }
  if (j.contains("waves"))
    c.waves = WaveBand{j["waves"]["shortest"], j["waves"]["longest"], j["waves"]["tolerance"]};
  for (const json& region : j.value("still", json::array())) {
    StillRegion r{region["name"]};
    for (int a = 0; a < 3; ++a) r.low[a] = region["box"]["low"][a], r.high[a] = region["box"]["high"][a];
    c.still.push_back(std::move(r));
  }
  for (const json& rule : j["frame_weights"])
    c.frame_weights.push_back({rule["from"], rule["to"], rule["weight"], rule["half_every"]});
  c.starts = j["starts"], c.local_fits = j["local_fits"], c.start_spread = j["start_spread"];
  c.screen_frames = j["screen_frames"], c.seed = j["seed"];
  return c;
}

/// Reads the parts of a case that mean something only together with its scene.
class ParameterReader {
 public:
  ParameterReader(const LocatedJson& located, const Scene& scene) : located_(located), scene_(scene) {}

  /// `named` is what its address means (parameters_named).
  FitParameter read(std::size_t index, const FitParameter& named) {
    const json& item = located_.json["fit"]["parameters"][index];
    pointer_ = "/fit/parameters/" + std::to_string(index);
    const ParameterSpec spec = describe_parameter(scene_, named.address);
    FitParameter p = named;
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

/// A scene or an experiment where a case is wanted, and values of the scene addressed as if they were the case's: said here,
/// since as unknown keys they would only be compared with the keys of cases.
void refuse_other_files(const LocatedJson& written, const std::string& path,
                        const std::vector<std::string>& settings) {
  if (written.json.contains("skin") && !written.json.contains("scene"))
    throw InputError(path, "a scene",
                     "a case, which names its scene (an example: data/scenes/demo/case.json)");
  if (written.json.contains("variants"))
    throw InputError(path, "an experiment",
                     "a case (rhytid study sweep runs experiments; an example: data/scenes/demo/case.json)");
  for (const std::string& setting : settings) {
    const std::vector<std::string> keys =
        split_pointer(std::string_view(setting).substr(0, setting.find('=')), "--set");
    if (keys.empty() || case_rule_tree().child(keys[0]) || !scene_rule_tree().child(keys[0])) continue;
    throw InputError("--set " + shown_json(setting), "a value of the scene",
                     "one of the case; this changes its scene: --set " +
                         shown_json(setting_address(written) + "=" + setting));
  }
}

/// The scenes of the fit. What their messages say to set is set through the case.
std::vector<Scene> scenes_of_fit(const Case& c, const LocatedJson& written) {
  try {
    return scenes_of(c);
  } catch (const InputError& error) {
    std::string text = error.what();
    const std::string advice = "e.g. --set /";
    if (const std::size_t at = text.find(advice); at != std::string::npos)
      text.insert(at + advice.size() - 1, setting_address(written) + "=");
    throw InputError(text);
  }
}

/// What a truth was changed from: scene and settings of a fit, and those settings that count also for a truth with
/// a scene of its own.
struct TruthBase {
  std::string scene;
  std::vector<Setting> settings, own;
};

/// Scene and settings of the truth that the case has at `pointer`. One without a scene is that of the fit.
std::pair<std::string, std::vector<Setting>> read_truth(const LocatedJson& located,
                                                        const std::string& pointer, const TruthBase& base) {
  const json& truth = located.json.at(json::json_pointer(pointer));
  const bool has_scene = truth.contains("scene");
  std::vector<Setting> settings = has_scene ? base.own : base.settings;
  for (const Setting& setting : settings_at(located, pointer + "/settings")) settings.push_back(setting);
  return {has_scene ? truth["scene"].get<std::string>() : base.scene, settings};
}

/// A camera of its own has its own image and unit too.
ViewCase read_view(const Case& c, const json& j, const std::string& pointer) {
  const auto text = [&j](const char* key) { return j.value(key, ""); };
  ViewCase view{"", pointer, c.camera, text("footage"), text("tracks"), c.camera_image, c.camera_unit};
  if (j.contains("camera")) view.camera = j["camera"], view.camera_image = "", view.camera_unit.reset();
  if (j.contains("camera_image")) view.camera_image = j["camera_image"];
  if (j.contains("camera_unit")) view.camera_unit = j["camera_unit"].get<double>();
  return view;
}

void read_clips(const LocatedJson& located, Case& c) {
  const json& root = located.json;
  for (const char* key : {"footage", "tracks", "measurements"})
    if (!root.value(key, "").empty())
      throw InputError(located.where(std::string("/") + key) + ": /" + key, shown_json(root[key]),
                       "that each of the clips has its own");
  for (std::size_t i = 0; i < root["clips"].size(); ++i) {
    const json& j = root["clips"][i];
    const std::string pointer = "/clips/" + std::to_string(i);
    ClipCase clip;
    clip.name = j["name"];
    for (const ClipCase& other : c.clips)
      if (other.name == clip.name)
        throw InputError(located.where(pointer + "/name") + ": " + pointer + "/name",
                         shown_text(clip.name) + " a second time", "a name of its own for each clip");
    clip.scene = j.value("scene", c.scene);
    clip.scene_settings = c.scene_settings;
    const std::vector<Setting> own = settings_at(located, pointer + "/settings");
    clip.scene_settings.insert(clip.scene_settings.end(), own.begin(), own.end());
    if (j.contains("truth"))
      std::tie(clip.truth_scene, clip.truth_settings) =
          read_truth(located, pointer + "/truth", {clip.scene, clip.scene_settings, {}});
    else if (root.contains("truth"))  // that of the case, as if the clip were the case
      std::tie(clip.truth_scene, clip.truth_settings) =
          read_truth(located, "/truth", {clip.scene, clip.scene_settings, own});
    clip.measurements = j.value("measurements", ""), clip.weight = j["weight"];
    if (j.contains("cameras"))
      for (std::size_t v = 0; v < j["cameras"].size(); ++v) {
        const json& seen = j["cameras"][v];
        clip.views.push_back(read_view(c, seen, pointer + "/cameras/" + std::to_string(v)));
        if (j["cameras"].size() > 1) clip.views.back().name = seen["name"];
      }
    else
      clip.views.push_back(read_view(c, j, pointer));
    c.clips.push_back(std::move(clip));
  }
}

void read_parameters(const LocatedJson& located, const std::vector<Scene>& scenes, Case& c) {
  const json& list = located.json["fit"]["parameters"];
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string pointer = "/fit/parameters/" + std::to_string(i) + "/address";
    const std::string where = located.where(pointer) + ": " + pointer;
    for (const FitParameter& named : parameters_named(c, scenes, list[i]["address"], where)) {
      for (const FitParameter& other : c.fit.parameters)
        if (other.address == named.address &&
            (other.clip == named.clip || other.clip.empty() || named.clip.empty()))
          throw InputError(where, shown_text(named.address) + " a second time", "each parameter once");
      // Values left open are those of the first scene that has the parameter.
      const auto knows = [&](std::size_t s) {
        if (!named.clip.empty()) return c.clips[s].name == named.clip;
        const auto all = all_parameters(scenes[s]);
        return std::any_of(all.begin(), all.end(),
                           [&](const ParameterSpec& spec) { return spec.address == named.address; });
      };
      std::size_t first = 0;
      while (first + 1 < scenes.size() && !knows(first)) ++first;
      c.fit.parameters.push_back(ParameterReader(located, scenes[first]).read(i, named));
    }
  }
}

void read_profiles(const LocatedJson& located, const std::vector<Scene>& scenes, Case& c) {
  const json& list = located.json["fit"]["profiles"];
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string pointer = "/fit/profiles/" + std::to_string(i);
    for (std::string& address :
         fitted_named(c, scenes, c.fit.parameters, list[i], located.where(pointer) + ": " + pointer))
      c.fit.profiles.push_back(std::move(address));
  }
}

}  // namespace

Case load_case(const std::string& path, const std::vector<std::string>& settings) {
  LocatedJson written = read_with_extends(path, case_rule_tree(), "case");
  refuse_other_files(written, path, settings);
  for (const std::string& assignment : settings)
    apply_override(written, {assignment}, path, case_rule_tree());
  const LocatedJson located = resolve_against_rules(written, case_rule_tree());
  const json& root = located.json;

  Case c;
  c.file = path, c.name = root["name"];
  c.scene = root["scene"], c.scene_settings = settings_at(located, "/settings");
  if (root.contains("truth"))
    std::tie(c.truth_scene, c.truth_settings) =
        read_truth(located, "/truth", {c.scene, c.scene_settings, {}});
  c.camera = root.value("camera", ""), c.camera_image = root["camera_image"];
  if (root.contains("camera_unit")) c.camera_unit = root["camera_unit"].get<double>();
  c.footage = root["footage"], c.tracks = root["tracks"], c.measurements = root.value("measurements", "");
  c.render = read_render(root["render"]);
  c.track = read_track(root["track"]);
  if (c.track.roi && ((*c.track.roi)[2] < 1 || (*c.track.roi)[3] < 1))
    throw InputError(located.where("/track/roi") + ": /track/roi", shown_json(root["track"]["roi"]),
                     "x, y, width and height with a width and a height of at least 1 px");
  if (c.track.window % 2 == 0)
    throw InputError(located.where("/track/window") + ": /track/window", std::to_string(c.track.window),
                     "an odd number of px, so that the window has a middle");
  c.fit = read_fit(root["fit"]);
  if (c.fit.wrinkles && !(c.fit.wrinkles->band.shortest < c.fit.wrinkles->band.longest))
    throw InputError(located.where("/fit/wrinkles/longest") + ": /fit/wrinkles/longest",
                     shown_json(located.json["fit"]["wrinkles"]["longest"]), "more than shortest");
  if (c.fit.waves && !(c.fit.waves->shortest < c.fit.waves->longest))
    throw InputError(located.where("/fit/waves/longest") + ": /fit/waves/longest",
                     shown_json(located.json["fit"]["waves"]["longest"]), "more than shortest");
  for (std::size_t i = 0; i < c.fit.still.size(); ++i)
    if (!(c.fit.still[i].low.array() < c.fit.still[i].high.array()).all()) {
      const std::string pointer = "/fit/still/" + std::to_string(i) + "/box";
      throw InputError(located.where(pointer) + ": " + pointer,
                       shown_json(located.json["fit"]["still"][i]["box"]), "low below high in x, y and z");
    }
  for (std::size_t i = 0; i < c.fit.frame_weights.size(); ++i)
    if (const FrameWeight& rule = c.fit.frame_weights[i]; rule.to != 0 && rule.to < rule.from) {
      const std::string pointer = "/fit/frame_weights/" + std::to_string(i) + "/to";
      throw InputError(located.where(pointer) + ": " + pointer, std::to_string(rule.to),
                       "0 (all from there on) or at least from, " + std::to_string(rule.from));
    }
  if (c.fit.last_frame != 0 && c.fit.last_frame < c.fit.first_frame)
    throw InputError(located.where("/fit/last_frame") + ": /fit/last_frame", std::to_string(c.fit.last_frame),
                     "0 (all frames) or at least first_frame, " + std::to_string(c.fit.first_frame));

  if (root.contains("clips")) read_clips(located, c);
  const std::vector<Scene> scenes = scenes_of_fit(c, written);
  if (c.name.empty())
    c.name = scenes[0].name.empty() || !c.clips.empty() ? fs::path(path).stem().string() : scenes[0].name;
  read_parameters(located, scenes, c);
  for (std::size_t i = 0; i < root["fit"]["stages"].size(); ++i) {
    const std::string pointer = "/fit/stages/" + std::to_string(i);
    const json& stage = root["fit"]["stages"][i];
    c.fit.stages.push_back(
        {settings_at(located, pointer + "/settings"), stage["last_frame"], stage["max_evaluations"]});
    const int last = c.fit.stages.back().last_frame;
    if (last > 0 && (last < c.fit.first_frame || (c.fit.last_frame > 0 && last > c.fit.last_frame)))
      throw InputError(located.where(pointer + "/last_frame") + ": " + pointer + "/last_frame",
                       std::to_string(last), "0 or a frame that the fit compares");
    try {
      (void)scenes_of_stage(c, c.fit.stages.back());
    } catch (const InputError& error) {
      throw InputError(located.where(pointer) + ": " + pointer + ": " + error.what());
    }
  }
  read_considered(located, scenes, c);
  read_profiles(located, scenes, c);
  for (const Scene& scene : scenes) check_gauge_layer(located, scene, c.fit.gauge_layer);
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
  return c.camera.empty() || is_colmap(c.camera) ? (fs::path(folder) / "camera.yaml").string() : c.camera;
}

}  // namespace rhytid::fitting
