// JSON Schema and Markdown from the rules table.
#include <cctype>
#include <cmath>

#include "sim/scene/load.h"
#include "sim/scene/schema.h"

namespace rhytid {
namespace {

using nlohmann::json;

/// A number, optionally with a unit expression; the units themselves are checked on reading.
constexpr const char* quantity_pattern =
    "^[ \\t]*[-+]?([0-9]+\\.?[0-9]*|\\.[0-9]+)([eE][-+]?[0-9]+)?[^0-9eE.].*$";
constexpr const char* plain_quantity_pattern =
    "^[ \\t]*[-+]?([0-9]+\\.?[0-9]*|\\.[0-9]+)([eE][-+]?[0-9]+)?([^0-9eE.].*)?$";
constexpr const char* name_pattern = "^(?![0-9]+$)[^/~=\\u0000-\\u001f\\u007f]+$";

void add_range(json& schema, const Rule& rule) {
  if (std::isfinite(rule.min)) schema[rule.min_is_open ? "exclusiveMinimum" : "minimum"] = rule.min;
  if (std::isfinite(rule.max)) schema[rule.max_is_open ? "exclusiveMaximum" : "maximum"] = rule.max;
}

json number_schema(const Rule& rule) {
  json number = {{"type", "number"}};
  add_range(number, rule);
  const bool is_plain = rule.dimension == dimension::none;
  const json text = {{"type", "string"}, {"pattern", is_plain ? plain_quantity_pattern : quantity_pattern}};
  return {{"anyOf", {number, text}}};
}

json integer_schema(const Rule& rule) {
  json integer = {{"type", "integer"}};
  add_range(integer, rule);
  return integer;
}

json list_schema(json item, int size) {
  return {{"type", "array"}, {"items", std::move(item)}, {"minItems", size}, {"maxItems", size}};
}

/// Documentation of a rule with unit and range, for hovering editors and for the tables.
std::string described(const Rule& rule) {
  std::string text = rule.doc;
  if (rule.dimension != dimension::none)
    text += " In " + unit_text(rule.dimension) + " or with a unit, e.g. \"" +
            dimension_example(rule.dimension) + "\".";
  return text;
}

/// `is_patch`: for a file that extends another one, where nothing is required, null removes a key and lists
/// of named items may be patched by an object.
json node_schema(const RuleNode& node, bool is_patch);

json object_schema(const RuleNode& node, bool is_patch) {
  json schema = {{"type", "object"}, {"additionalProperties", false}, {"properties", json::object()}};
  json required = json::array(), conditions = json::array();
  for (const auto& [key, child] : node.children) {
    const Rule& rule = *child.rule;
    json property = node_schema(child, is_patch);
    schema["properties"][key] = is_patch ? json{{"anyOf", {property, {{"type", "null"}}}}} : property;
    if (is_patch) continue;
    if (rule.is_required) required.push_back(key);
    if (!rule.rival.empty() && rule.needs_one_of_pair)
      conditions.push_back(
          {{"oneOf", {{{"required", json::array({key})}}, {{"required", json::array({rule.rival})}}}}});
    else if (!rule.rival.empty())
      conditions.push_back({{"not", {{"required", json::array({key, rule.rival})}}}});
    if (!rule.needs.empty()) schema["dependentRequired"][key] = json::array({rule.needs});
  }
  if (!required.empty()) schema["required"] = required;
  if (!conditions.empty()) schema["allOf"] = conditions;
  return schema;
}

json array_schema(const RuleNode& node, bool is_patch) {
  json list = {{"type", "array"}, {"items", node_schema(*node.child("*"), false)}};
  if (node.rule->min > 0) list["minItems"] = static_cast<int>(node.rule->min);
  if (!is_patch || !node.is_named_list()) return list;
  const json item = {{"anyOf", {node_schema(*node.child("*"), true), {{"type", "null"}}}}};
  return {{"anyOf", {list, {{"type", "object"}, {"additionalProperties", item}}}}};
}

json node_schema(const RuleNode& node, bool is_patch) {
  const Rule& rule = *node.rule;
  json schema;
  switch (rule.type) {
    case RuleType::object:
      schema = object_schema(node, is_patch);
      break;
    case RuleType::array:
      schema = array_schema(node, is_patch);
      break;
    case RuleType::number:
      schema = number_schema(rule);
      break;
    case RuleType::quantity:
      schema = {{"type", json::array({"number", "string"})}};
      break;
    case RuleType::integer:
      schema = integer_schema(rule);
      break;
    case RuleType::string:
      schema = {{"type", "string"}};
      break;
    case RuleType::name:
      schema = {{"type", "string"}, {"pattern", name_pattern}, {"maxLength", 200}};
      break;
    case RuleType::path:
      schema = {{"type", "string"}, {"minLength", 1}};
      break;
    case RuleType::boolean:
      schema = {{"type", "boolean"}};
      break;
    case RuleType::option:
      schema = {{"type", "string"}, {"enum", rule.options}};
      break;
    case RuleType::vector2:
      schema = list_schema(number_schema(rule), 2);
      break;
    case RuleType::vector3:
      schema = list_schema(number_schema(rule), 3);
      break;
    case RuleType::integers2:
      schema = list_schema(integer_schema(rule), 2);
      break;
  }
  schema["description"] = described(rule);
  if (!rule.fallback.is_null() && !is_patch) schema["default"] = rule.fallback;
  return schema;
}

/// A cell of a Markdown table.
std::string cell(std::string text) {
  for (size_t i = 0; (i = text.find('|', i)) != std::string::npos; i += 2) text.insert(i, "\\");
  return text;
}

std::string type_text(const Rule& rule) {
  switch (rule.type) {
    case RuleType::object:
      return "object";
    case RuleType::array:
      return "list";
    case RuleType::number:
      return "number";
    case RuleType::integer:
      return "integer";
    case RuleType::string:
      return "string";
    case RuleType::name:
      return "name";
    case RuleType::path:
      return "file";
    case RuleType::boolean:
      return "true/false";
    case RuleType::vector2:
      return "2 numbers";
    case RuleType::vector3:
      return "3 numbers";
    case RuleType::integers2:
      return "2 integers";
    case RuleType::quantity:
      return "number with a unit";
    case RuleType::option:
      break;
  }
  std::string words;
  for (const std::string& option : rule.options) words += (words.empty() ? "`" : ", `") + option + "`";
  return words;
}

std::string default_text(const Rule& rule) {
  if (rule.is_required) return "required";
  if (rule.needs_one_of_pair) return "this or `" + rule.rival + "`";
  if (rule.fallback.is_null()) return "absent";
  if (rule.type == RuleType::object || rule.type == RuleType::array) return "";
  return "`" + rule.fallback.dump() + "`";
}

constexpr const char* introduction = R"(# The scene file

<!-- Generated from the rules table by `rhytid schema --docs`; edit the table instead. -->

JSON with `//` and `/* */` comments. Plain numbers are in mm, N, MPa, s and what follows from them; a string with
a unit is converted: `"20 kPa"`, `"0.8 1/mm"`, `"20 mm^2"`, `"24 Hz"`, `"30 deg"`, `"80 %"`. A wrong dimension, an
unknown key or a value out of range is an error that names the file, the line, the key, the value and what was
expected.

`"extends": "other.json"` starts from another file and applies this one as a merge patch (RFC 7386): objects merge
key by key, `null` removes a key, everything else replaces. Lists of named items (layers, sources, colliders) may
also be patched by an object keyed by name, which changes, appends (in alphabetical order, after the others) or,
with `null`, removes single items; a list replaces the whole list:

```json
{"extends": "two-layers.json", "skin": {"layers": {"film": {"youngs_modulus": "8 MPa"}, "fat": null}}}
```

Paths are relative to the file that mentions them. On the command line `--set /pointer=value` overrides single
values after extending; items are addressed by number or by name: `--set "/skin/layers/film/youngs_modulus=8 MPa"`.
Paths given there are relative to the working directory. In the tables `*` stands for an item of a list.
)";

}  // namespace

json format_schema(const RuleNode& rules, const std::string& name) {
  const json extends = {
      {"type", "string"}, {"minLength", 1}, {"description", "The " + name + " file to start from."}};
  json patch = node_schema(rules, true);
  patch["properties"]["extends"] = extends;
  return {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
          {"title", "Rhytid " + name},
          {"description", "Plain numbers are in mm, N, MPa, s; strings carry a unit."},
          {"$defs", {{name, node_schema(rules, false)}, {"patch", patch}}},
          {"if", {{"type", "object"}, {"required", json::array({"extends"})}}},
          {"then", {{"$ref", "#/$defs/patch"}}},
          {"else", {{"$ref", "#/$defs/" + name}}}};
}

std::string format_documentation(const std::vector<Rule>& rules, const RuleNode& tree,
                                 const std::string& name, const std::string& introduction) {
  std::string text = introduction, title = name;
  title[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(title[0])));
  const std::string header =
      "| key | type | unit | range | default | meaning |\n| --- | --- | --- | --- | --- | --- |\n";
  std::string section = "(none)";
  for (const Rule& rule : rules) {
    if (rule.pointer.empty()) continue;
    const size_t second = rule.pointer.find('/', 1);
    const RuleNode& top = *tree.child(rule.pointer.substr(1, second - 1));
    const RuleNode* item = top.child("*");  // lists of plain values need no section
    const bool has_children =
        !top.children.empty() && (item == nullptr || item->rule->type == RuleType::object);
    const std::string wanted = has_children ? rule.pointer.substr(1, second - 1) : "";
    if (wanted != section) {
      section = wanted;
      text += "\n## " + (section.empty() ? title : "`" + section + "`") + "\n\n" + header;
    }
    text += "| `" + rule.pointer + "` | " + cell(type_text(rule)) + " | " + unit_text(rule.dimension) +
            " | " + (rule.type == RuleType::array ? (rule.min > 0 ? "at least 1" : "") : range_text(rule)) +
            " | " + cell(default_text(rule)) + " | " + cell(rule.doc) +
            (rule.needs.empty() ? "" : " Only with `" + rule.needs + "`.") + " |\n";
  }
  return text;
}

json scene_schema() {
  return format_schema(scene_rule_tree(), "scene");
}

std::string scene_documentation() {
  return format_documentation(scene_rules(), scene_rule_tree(), "scene", introduction);
}

}  // namespace rhytid
