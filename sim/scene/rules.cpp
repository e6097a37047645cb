#include "sim/scene/rules.h"

#include <charconv>
#include <cmath>

#include "sim/scene/rules_table.h"

namespace rhytid {
namespace {

void insert(RuleNode& root, const Rule& rule) {
  RuleNode* node = &root;
  for (size_t begin = 1; begin <= rule.pointer.size();) {
    const size_t end = std::min(rule.pointer.find('/', begin), rule.pointer.size());
    const std::string key = rule.pointer.substr(begin, end - begin);
    if (const RuleNode* found = node->child(key)) {
      node = const_cast<RuleNode*>(found);
    } else {
      node->children.push_back({key, RuleNode{}});
      node = &node->children.back().node;
    }
    begin = end + 1;
  }
  node->rule = &rule;
}

/// Shortest text that reads back as the same double: "0.49999", "1e-10", "10000".
std::string number_text(double value) {
  if (value == std::floor(value) && std::abs(value) < 1e15)
    return std::to_string(static_cast<long long>(value));
  char buffer[32];
  const auto [end, status] = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return {buffer, end};
}

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "\"" : ", \"") + word + "\"";
  return text;
}

}  // namespace

const std::vector<Rule>& scene_rules() {
  static const std::vector<Rule> rules = [] {
    std::vector<Rule> all = {
        {.pointer = "", .type = RuleType::object, .is_required = true, .doc = "A scene."},
        {.pointer = "/$schema", .type = RuleType::string, .doc = "For editors; ignored."},
        {.pointer = "/name", .type = RuleType::string, .fallback = "", .doc = "Short name of the scene."},
        {.pointer = "/description", .type = RuleType::string, .fallback = "", .doc = "What it shows."},
    };
    for (std::vector<Rule> (*group)() : {&skin_rules, &ligament_rules, &contact_rules, &run_rules})
      for (Rule& rule : group()) all.push_back(std::move(rule));
    return all;
  }();
  return rules;
}

const RuleNode* RuleNode::child(std::string_view key) const {
  for (const auto& [name, node] : children)
    if (name == key) return &node;
  return nullptr;
}

bool RuleNode::is_named_list() const {
  const RuleNode* item = child("*");
  return item != nullptr && item->child("name") != nullptr;
}

RuleNode build_rule_tree(const std::vector<Rule>& rules) {
  RuleNode root;
  for (const Rule& rule : rules) insert(root, rule);
  return root;
}

const RuleNode& scene_rule_tree() {
  static const RuleNode root = build_rule_tree(scene_rules());
  return root;
}

const Rule* find_rule(std::string_view pattern) {
  for (const Rule& rule : scene_rules())
    if (rule.pointer == pattern) return &rule;
  return nullptr;
}

bool is_in_range(const Rule& rule, double value) {
  const bool above = rule.min_is_open ? value > rule.min : value >= rule.min;
  const bool below = rule.max_is_open ? value < rule.max : value <= rule.max;
  return above && below;
}

std::string range_text(const Rule& rule) {
  const std::string unit = unit_text(rule.dimension).empty() ? "" : " " + unit_text(rule.dimension);
  const bool has_min = std::isfinite(rule.min), has_max = std::isfinite(rule.max);
  const std::string min = number_text(has_min ? rule.min : 0), max = number_text(has_max ? rule.max : 0);
  if (has_min && has_max && !rule.min_is_open && !rule.max_is_open)
    return "from " + min + " to " + max + unit;
  std::string text;
  if (has_min) text += (rule.min_is_open ? "> " : ">= ") + min + unit;
  if (has_max)
    text += (text.empty() ? "" : " and ") + std::string(rule.max_is_open ? "< " : "<= ") + max + unit;
  return text;
}

std::string expectation(const Rule& rule) {
  const std::string range = range_text(rule).empty() ? "" : " " + range_text(rule);
  const std::string unit =
      unit_text(rule.dimension).empty() ? "" : " (plain numbers in " + unit_text(rule.dimension) + ")";
  const bool is_plain = rule.dimension == dimension::none;
  switch (rule.type) {
    case RuleType::object:
      return "an object {...}";
    case RuleType::array:
      return rule.min > 0
                 ? "a list of at least " + number_text(rule.min) + (rule.min == 1 ? " item" : " items")
                 : "a list [...]";
    case RuleType::number:
      if (is_plain) return "a number" + range;
      return dimension_text(rule.dimension) + range + ", e.g. \"" + dimension_example(rule.dimension) + "\"";
    case RuleType::quantity:
      return "a number, or a string with a unit, e.g. \"20 kPa\"";
    case RuleType::integer:
      return "an integer" + range;
    case RuleType::string:
      return "a string";
    case RuleType::name:
      return "a name (a string, not only digits, without / ~ = and control characters)";
    case RuleType::path:
      return "the path of a file";
    case RuleType::boolean:
      return "true or false";
    case RuleType::option:
      return "one of " + join(rule.options);
    case RuleType::vector2:
      return "a list of 2 numbers" + (range.empty() ? unit : range);
    case RuleType::vector3:
      return "a list of 3 numbers" + (range.empty() ? unit : range);
    case RuleType::integers2:
      return "a list of 2 integers" + range;
  }
  return "";
}

}  // namespace rhytid
