#include "schema_checker.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <regex>
#include <stdexcept>

namespace rhytid::testing {
namespace {

using nlohmann::json;

bool has_type(const json& value, const std::string& type) {
  if (type == "integer") return value.is_number() && value.get<double>() == std::floor(value.get<double>());
  if (type == "number") return value.is_number();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "null") return value.is_null();
  throw std::runtime_error("unknown type " + type);
}

const std::regex& compiled(const std::string& pattern) {
  static std::map<std::string, std::regex> cache;
  const auto found = cache.find(pattern);
  return found != cache.end() ? found->second : cache.emplace(pattern, std::regex(pattern)).first->second;
}

bool all_present(const json& value, const json& keys) {
  return !value.is_object() ||
         std::all_of(keys.begin(), keys.end(), [&value](const json& key) { return value.contains(key); });
}

bool properties_hold(const json& value, const json& schema, const json& root) {
  if (!value.is_object()) return true;
  for (const auto& [key, item] : value.items()) {
    const bool is_named = schema.contains("properties") && schema["properties"].contains(key);
    if (is_named && !satisfies(item, schema["properties"][key], root)) return false;
    if (!is_named && schema.contains("additionalProperties")) {
      const json& rest = schema["additionalProperties"];
      if (rest.is_boolean() ? !rest.get<bool>() : !satisfies(item, rest, root)) return false;
    }
  }
  return true;
}

bool keyword_holds(const std::string& keyword, const json& rule, const json& value, const json& schema,
                   const json& root) {
  const auto holds = [&](const json& part) { return satisfies(value, part, root); };
  if (keyword == "type") return has_type(value, rule);
  if (keyword == "enum") return std::find(rule.begin(), rule.end(), value) != rule.end();
  if (keyword == "minimum") return !value.is_number() || value.get<double>() >= rule.get<double>();
  if (keyword == "maximum") return !value.is_number() || value.get<double>() <= rule.get<double>();
  if (keyword == "exclusiveMinimum") return !value.is_number() || value.get<double>() > rule.get<double>();
  if (keyword == "exclusiveMaximum") return !value.is_number() || value.get<double>() < rule.get<double>();
  if (keyword == "pattern")
    return !value.is_string() ||
           std::regex_search(value.get<std::string>(), compiled(rule.get<std::string>()));
  if (keyword == "minLength")
    return !value.is_string() || value.get<std::string>().size() >= rule.get<size_t>();
  if (keyword == "maxLength")
    return !value.is_string() || value.get<std::string>().size() <= rule.get<size_t>();
  if (keyword == "minItems") return !value.is_array() || value.size() >= rule.get<size_t>();
  if (keyword == "maxItems") return !value.is_array() || value.size() <= rule.get<size_t>();
  if (keyword == "items")
    return !value.is_array() || std::all_of(value.begin(), value.end(),
                                            [&](const json& item) { return satisfies(item, rule, root); });
  if (keyword == "properties" || keyword == "additionalProperties")
    return properties_hold(value, schema, root);
  if (keyword == "required") return all_present(value, rule);
  if (keyword == "dependentRequired") {
    for (const auto& [key, keys] : rule.items())
      if (value.is_object() && value.contains(key) && !all_present(value, keys)) return false;
    return true;
  }
  if (keyword == "anyOf") return std::any_of(rule.begin(), rule.end(), holds);
  if (keyword == "oneOf") return std::count_if(rule.begin(), rule.end(), holds) == 1;
  if (keyword == "allOf") return std::all_of(rule.begin(), rule.end(), holds);
  if (keyword == "not") return !holds(rule);
  if (keyword == "if") return holds(schema[holds(rule) ? "then" : "else"]);
  if (keyword == "$ref") return holds(root.at(json::json_pointer(rule.get<std::string>().substr(1))));
  for (const char* passive : {"$schema", "$defs", "title", "description", "default", "then", "else"})
    if (keyword == passive) return true;
  throw std::runtime_error("unknown keyword " + keyword);
}

}  // namespace

bool satisfies(const json& value, const json& schema, const json& root) {
  for (const auto& [keyword, rule] : schema.items())
    if (!keyword_holds(keyword, rule, value, schema, root)) return false;
  return true;
}

}  // namespace rhytid::testing
