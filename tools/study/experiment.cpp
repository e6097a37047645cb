#include "tools/study/experiment.h"

#include <algorithm>
#include <set>

#include "sim/core/error.h"
#include "sim/output/text.h"
#include "sim/scene/located_json.h"
#include "sim/scene/schema.h"
#include "sim/scene/validate.h"
#include "tools/study/plan.h"
#include "tools/study/sweep_report.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

using nlohmann::json;

Rule settings_rule(const std::string& pointer, const std::string& doc) {
  return {.pointer = pointer, .type = RuleType::array, .fallback = json::array(), .doc = doc};
}

Rule text_rule(const std::string& pointer) {
  return {.pointer = pointer, .type = RuleType::string, .doc = "One change."};
}

Vec3 vector_of(const json& j) {
  return {j[0].get<double>(), j[1].get<double>(), j[2].get<double>()};
}

WrinkleMeasure read_measure(const json& j) {
  WrinkleMeasure m;
  if (j.contains("wavelengths")) m.band = {j["wavelengths"][0], j["wavelengths"][1]};
  if (j.contains("line")) {
    m.line = SampleLine{vector_of(j["line"]["from"]), vector_of(j["line"]["to"])};
    m.line_points = j["line"]["points"];
  }
  if (j.contains("window")) {
    m.window = surface_window(j["window"]);
    m.window_spacing = j["window"]["spacing"];
  }
  return m;
}

/// What no single rule can say.
void check(const LocatedJson& located) {
  const json& root = located.json;
  const RefuseValue refuse = [&](const std::string& at, const std::string& got, const std::string& expected) {
    throw InputError(located.where(at) + ": " + at, got, expected);
  };
  std::set<std::string> seen;
  for (std::size_t i = 0; i < root["variants"].size(); ++i) {
    const std::string name = root["variants"][i]["name"];
    const std::string at = "/variants/" + std::to_string(i) + "/name";
    if (!seen.insert(name).second)
      refuse(at, shown_json(name) + " a second time", "a name of its own for each");
    check_variant_name(name, located.where(at) + ": " + at);
  }
  const json& measure = root["measure"];
  if (measure.contains("wavelengths") && measure["wavelengths"][0] >= measure["wavelengths"][1])
    refuse("/measure/wavelengths", shown_json(measure["wavelengths"]), "the shorter one first");
  if (measure.contains("line") && measure["line"]["from"] == measure["line"]["to"])
    refuse("/measure/line", "the same point twice", "two ends");
  if (measure.contains("window")) check_surface_window(measure["window"], "/measure/window", refuse);
  if (root.contains("compare")) check_comparison(root["compare"], seen, refuse);
}

std::vector<Rule> variant_rules() {
  return {
      {.pointer = "/variants",
       .type = RuleType::array,
       .is_required = true,
       .min = 1,
       .doc = "What is run, in this order."},
      {.pointer = "/variants/*", .type = RuleType::object, .doc = "One variant."},
      {.pointer = "/variants/*/name",
       .type = RuleType::name,
       .is_required = true,
       .doc = "Unique; the name of its folder."},
      {.pointer = "/variants/*/size",
       .type = RuleType::option,
       .fallback = "both",
       .options = {"both", "quick", "full"},
       .doc = "At which size it is run."},
      settings_rule("/variants/*/settings", "Its changes of the scene."),
      text_rule("/variants/*/settings/*"),
      settings_rule("/variants/*/quick", "Further changes at the quick size."),
      text_rule("/variants/*/quick/*"),
      settings_rule("/variants/*/full", "Further changes at the full size."),
      text_rule("/variants/*/full/*"),
  };
}

/// All of them, parents before children.
std::vector<Rule> make_rules() {
  const WrinkleMeasure m;
  std::vector<Rule> rules = {
      {.pointer = "", .type = RuleType::object, .is_required = true, .doc = "An experiment."},
      {.pointer = "/$schema", .type = RuleType::string, .doc = "For editors; ignored."},
      {.pointer = "/name", .type = RuleType::string, .fallback = "", .doc = "Short name."},
      {.pointer = "/description", .type = RuleType::string, .fallback = "", .doc = "What it shows."},
      {.pointer = "/scene", .type = RuleType::path, .is_required = true, .doc = "Scene of all variants."},
      settings_rule("/settings", "Changes of that scene, \"/pointer=value\", for all variants."),
      text_rule("/settings/*"),
      settings_rule("/quick", "Further changes at the quick size."),
      text_rule("/quick/*"),
      settings_rule("/full", "Further changes at the full size."),
      text_rule("/full/*"),
      {.pointer = "/measure",
       .type = RuleType::object,
       .fallback = json::object(),
       .doc = "Where wrinkles are measured, on the outer surface, from displacements along its normals."},
      {.pointer = "/measure/wavelengths",
       .type = RuleType::vector2,
       .dimension = dimension::length,
       .min = 0,
       .doc = "What counts as a wrinkle: waves between these lengths; without it nothing is filtered."},
      {.pointer = "/measure/line", .type = RuleType::object, .doc = "A line on the surface at rest."},
      {.pointer = "/measure/line/from",
       .type = RuleType::vector3,
       .dimension = dimension::length,
       .is_required = true,
       .doc = "One end; moved to the surface."},
      {.pointer = "/measure/line/to",
       .type = RuleType::vector3,
       .dimension = dimension::length,
       .is_required = true,
       .doc = "The other."},
      {.pointer = "/measure/line/points",
       .type = RuleType::integer,
       .fallback = m.line_points,
       .min = 3,
       .max = 100000,
       .doc = "Points along it."},
      {.pointer = "/measure/window", .type = RuleType::object, .doc = "A rectangle on the surface at rest."},
  };
  for (Rule& rule : surface_window_rules("/measure/window")) rules.push_back(std::move(rule));
  for (Rule& rule : comparison_rules()) rules.push_back(std::move(rule));
  for (Rule& rule : variant_rules()) rules.push_back(std::move(rule));
  return rules;
}

}  // namespace

const char* name(StudySize size) {
  return size == StudySize::quick ? "quick" : "full";
}

const std::vector<Rule>& experiment_rules() {
  static const std::vector<Rule> rules = make_rules();
  return rules;
}

namespace {

const RuleNode& rule_tree() {
  static const RuleNode root = build_rule_tree(experiment_rules());
  return root;
}

}  // namespace

nlohmann::json experiment_schema() {
  return format_schema(rule_tree(), "experiment");
}

std::string experiment_documentation() {
  return format_documentation(experiment_rules(), rule_tree(), "experiment", R"(# Experiment files

An experiment is JSON with comments: a scene, the variants of it that `rhytid study sweep` runs side by side, and where
their wrinkles are measured. With `compare`, `rhytid bench pareto` sets errors of its variants against their run time.
Settings are those of `--set`; later ones win: of the experiment, of the size, of the variant, of the variant at the size,
of the command line. `rhytid schema` describes scenes.
)");
}

void check_variant_name(const std::string& name, const std::string& where) {
  // It becomes the name of a folder beside the tables.
  if (name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+.") !=
          std::string::npos ||
      name.empty() || name.front() == '.')
    throw InputError(where, shown_json(name), "letters, digits, _ - + and dots");
  for (const auto& [files, study] : {std::pair{&sweep_files(), "sweep"}, {&plan_files(), "plan"}})
    if (std::find(files->begin(), files->end(), name) != files->end())
      throw InputError(where, shown_json(name) + ", which is a file of the " + study, "another name");
}

namespace {

nlohmann::json any_file(const std::string& path) {
  return read_with_extends(path, rule_tree(), "scene or experiment").json;
}

}  // namespace

bool is_experiment(const std::string& path) {
  return any_file(path).contains("variants");
}

void refuse_case(const std::string& path) {
  if (other_file(any_file(path)) == OtherFile::a_case)
    throw InputError(path, "a case", "an experiment or a scene, such as the one that the case names");
}

OtherFile other_file(const nlohmann::json& root) {
  if (root.contains("variants")) return OtherFile::none;
  if (root.contains("scene"))
    for (const char* key : {"fit", "track", "tracks", "footage", "camera", "render", "truth"})
      if (root.contains(key)) return OtherFile::a_case;
  return root.contains("skin") ? OtherFile::a_scene : OtherFile::none;
}

std::string variant_names(const Experiment& experiment) {
  constexpr std::size_t most = 20;  // of a grid
  std::string text;
  for (std::size_t i = 0; i < std::min(experiment.variants.size(), most); ++i)
    text += (text.empty() ? "" : ", ") + experiment.variants[i].name;
  return text + (experiment.variants.size() > most ? ", ..." : "");
}

Experiment load_experiment(const std::string& path, StudySize size, const char* if_scene) {
  const LocatedJson written = read_with_extends(path, rule_tree(), "experiment");
  // Said here, since its keys would only be compared with those of experiments.
  if (const OtherFile other = other_file(written.json); other != OtherFile::none)
    throw InputError(path, other == OtherFile::a_case ? "a case" : "a scene",
                     "an experiment, which names its scene and lists variants (an example: "
                     "data/scenes/sheared_sheet/experiment.json)" +
                         std::string(other == OtherFile::a_scene ? if_scene : ""));
  const LocatedJson located = resolve_against_rules(written, rule_tree());
  check(located);
  const json& root = located.json;
  Experiment e;
  e.file = path;
  e.name = root["name"], e.description = root["description"], e.scene = root["scene"];
  if (e.name.empty()) e.name = name_of_file(path);
  e.measure = read_measure(root["measure"]);
  e.measure_json = root["measure"];
  const std::string of_size = std::string("/") + name(size);
  for (std::size_t i = 0; i < root["variants"].size(); ++i) {
    const json& v = root["variants"][i];
    if (v["size"] != "both" && v["size"] != name(size)) continue;
    Variant variant;
    variant.name = v["name"];
    const std::string at = "/variants/" + std::to_string(i);
    for (const std::string& list : {std::string("/settings"), of_size, at + "/settings", at + of_size})
      for (Setting& setting : settings_at(located, list)) {
        check_setting(setting.text, setting.origin);
        variant.settings.push_back(std::move(setting));
      }
    e.variants.push_back(std::move(variant));
  }
  if (e.variants.empty())
    throw InputError(path + ": /variants", std::string("none at the size ") + name(size), "at least one");
  if (root.contains("compare")) {
    std::set<std::string> run;
    for (const Variant& v : e.variants) run.insert(v.name);
    e.comparison = read_comparison(root["compare"], run);
  }
  return e;
}

}  // namespace rhytid::tools
