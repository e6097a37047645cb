// Merging, extending and overriding (located_json.h).
#include <charconv>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "sim/core/error.h"
#include "sim/scene/located_json.h"
#include "sim/scene/nearest.h"
#include "sim/scene/rules.h"

namespace rhytid {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// Removes the origins of a value and of everything in it.
void forget(LocatedJson& target, const std::string& pointer) {
  target.origin.erase(pointer);
  const auto begin = target.origin.lower_bound(pointer + "/");
  const auto end = target.origin.lower_bound(pointer + "0");  // '0' follows '/'
  target.origin.erase(begin, end);
}

/// Gives the value at `to` the origins that `patch` has at `from`.
void adopt_origins(LocatedJson& target, const std::string& to, const LocatedJson& patch,
                   const std::string& from) {
  forget(target, to);
  target.origin[to] = patch.where(from);
  const auto end = patch.origin.lower_bound(from + "0");
  for (auto it = patch.origin.lower_bound(from + "/"); it != end; ++it)
    target.origin[to + it->first.substr(from.size())] = it->second;
}

class Merger {
 public:
  Merger(LocatedJson& target, const LocatedJson& patch) : target_(target), patch_(patch) {}

  void run(const RuleNode& rules) { value(target_.json, "", patch_.json, "", &rules); }

 private:
  void value(json& into, const std::string& to, const json& patch, const std::string& from,
             const RuleNode* node) {
    if (!patch.is_object()) {
      into = patch;
      adopt_origins(target_, to, patch_, from);
      return;
    }
    if (into.is_array() && node != nullptr && node->is_named_list())
      return named_list(into, to, patch, from, node);
    if (!into.is_object()) {
      into = json::object();
      forget(target_, to);
      target_.origin[to] = patch_.where(from);
    }
    for (const auto& [key, item] : patch.items()) {
      const std::string step = "/" + escape_key(key);
      if (item.is_null()) {
        into.erase(key);
        forget(target_, to + step);
      } else {
        value(into[key], to + step, item, from + step, node == nullptr ? nullptr : node->child(key));
      }
    }
  }

  void named_list(json& into, const std::string& to, const json& patch, const std::string& from,
                  const RuleNode* node) {
    for (const auto& [name, item] : patch.items()) {
      int index = find_named(into, name);
      const std::string item_from = from + "/" + escape_key(name);
      if (item.is_null()) {
        if (index >= 0) remove_item(into, to, index);
        continue;
      }
      if (index < 0) {
        index = static_cast<int>(into.size());
        into.push_back(item.is_object() ? json{{"name", name}} : json());
        target_.origin[to + "/" + std::to_string(index)] = patch_.where(item_from);
      }
      value(into[static_cast<size_t>(index)], to + "/" + std::to_string(index), item, item_from,
            node->child("*"));
    }
  }

  /// Items behind the removed one move up, and so do their origins.
  void remove_item(json& list, const std::string& pointer, int index) {
    const LocatedJson old{.json = nullptr, .origin = target_.origin};
    list.erase(static_cast<size_t>(index));
    for (int i = index; i < static_cast<int>(list.size()); ++i)
      adopt_origins(target_, pointer + "/" + std::to_string(i), old, pointer + "/" + std::to_string(i + 1));
    forget(target_, pointer + "/" + std::to_string(list.size()));
  }

  LocatedJson& target_;
  const LocatedJson& patch_;
};

std::string read_text(const std::string& path, const std::string& mentioned_at, const std::string& kind) {
  const std::string where = mentioned_at.empty() ? path : mentioned_at;
  std::error_code error;
  if (fs::is_directory(path, error)) throw InputError(where, "the directory " + path, "a " + kind + " file");
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  if (stream) text << stream.rdbuf();
  if (!stream || stream.bad())
    throw InputError(
        where, fs::exists(path, error) ? path + ", which cannot be read" : path + ", which does not exist",
        "a readable " + kind + " file");
  return text.str();
}

fs::path resolved(const std::string& file, const fs::path& folder) {
  return (fs::path(file).is_absolute() ? fs::path(file) : folder / file).lexically_normal();
}

/// Makes the paths in `value` absolute, wherever the rules expect a path.
void resolve_paths(json& value, const RuleNode& node, const fs::path& folder) {
  if (node.rule != nullptr && node.rule->type == RuleType::path) {
    if (value.is_string() && !value.get_ref<const std::string&>().empty())
      value = fs::absolute(resolved(value.get<std::string>(), folder)).lexically_normal().string();
    return;
  }
  for (const auto& [key, child] : node.children) {
    if (key == "*") {
      if (value.is_array() || value.is_object())
        for (json& item : value) resolve_paths(item, child, folder);
    } else if (value.is_object() && value.contains(key)) {
      resolve_paths(value[key], child, folder);
    }
  }
}

LocatedJson read_file(const std::string& path, const std::string& mentioned_at, const RuleNode& rules,
                      const std::string& kind, std::vector<fs::path>& chain) {
  std::error_code error;
  const fs::path identity = fs::weakly_canonical(path, error);
  for (const fs::path& earlier : chain)
    if (earlier == identity)
      throw InputError(mentioned_at, path + ", which extends this file again", "no cycle");
  chain.push_back(identity);

  LocatedJson own = parse_located(read_text(path, mentioned_at, kind), path);
  if (!own.json.is_object()) throw InputError(own.where(""), shown_json(own.json), "an object {...}");
  const fs::path folder = fs::path(path).parent_path();
  resolve_paths(own.json, rules, folder);

  LocatedJson result;
  if (own.json.contains("extends")) {
    const json base = own.json["extends"];
    const std::string where = own.where("/extends") + ": /extends";
    if (!base.is_string() || base.get_ref<const std::string&>().empty())
      throw InputError(where, shown_json(base), "the path of a " + kind + " file");
    own.json.erase("extends");
    forget(own, "/extends");
    result = read_file(resolved(base.get<std::string>(), folder).string(), where, rules, kind, chain);
  } else {
    result.json = json::object();
  }
  merge(result, own, rules);
  result.origin[""] = own.where("");
  return result;
}

/// Whether a list holds plain values: one behind the last may then be set and is appended.
bool is_plain_list(const RuleNode* list) {
  const RuleNode* item = list == nullptr ? nullptr : list->child("*");
  return item != nullptr && item->rule != nullptr && item->rule->type == RuleType::string;
}

/// Index for a key in an address of a list: a number or a name.
size_t item_index(const json& list, const std::string& key, const std::string& where,
                  const std::string& pointer, bool may_append) {
  size_t index = 0;
  const auto [end, status] = std::from_chars(key.data(), key.data() + key.size(), index);
  if (status == std::errc() && end == key.data() + key.size()) {
    if (index < list.size() + (may_append ? 1 : 0)) return index;
    throw InputError(where, "item " + key.substr(0, 60) + " of " + shown_text(pointer),
                     "an item below " + std::to_string(list.size() + (may_append ? 1 : 0)));
  }
  if (const int named = find_named(list, key); named >= 0) return static_cast<size_t>(named);
  std::vector<std::string> names;
  for (const json& item : list)
    if (item.is_object() && item.contains("name") && item["name"].is_string()) names.push_back(item["name"]);
  const std::string nearest = nearest_word(key, names);
  throw InputError(
      where, shown_json(key) + " in " + shown_text(pointer),
      "the number" + (nearest.empty() ? std::string(" of an item")
                                      : " or name of an item, nearest is " + shown_json(nearest)));
}

}  // namespace

void merge(LocatedJson& target, const LocatedJson& patch, const RuleNode& rules) {
  Merger(target, patch).run(rules);
}

LocatedJson read_with_extends(const std::string& path, const RuleNode& rules, const std::string& kind) {
  std::vector<fs::path> chain;
  return read_file(path, "", rules, kind, chain);
}

std::vector<Setting> of_command_line(const std::vector<std::string>& texts) {
  std::vector<Setting> settings;
  for (const std::string& text : texts) settings.push_back({text});
  return settings;
}

std::vector<Setting> settings_at(const LocatedJson& located, const std::string& pointer) {
  std::vector<Setting> settings;
  const json::json_pointer list(pointer);
  if (!located.json.contains(list)) return settings;
  for (const json& item : located.json[list]) {
    const std::string at = pointer + "/" + std::to_string(settings.size());
    const std::string where = located.where(at) + ": " + at;
    if (!item.is_string()) throw InputError(where, shown_json(item), "\"/pointer=value\"");
    settings.push_back({item, where});
  }
  return settings;
}

void apply_override(LocatedJson& target, const Setting& setting, const std::string& file,
                    const RuleNode& rules) {
  const std::string& assignment = setting.text;
  const bool is_typed = setting.origin.empty();
  const std::string where = (is_typed ? "--set " : setting.origin + " ") + shown_json(assignment);
  const std::string origin = is_typed ? file + " (--set)" : setting.origin;
  const size_t equals = assignment.find('=');
  if (equals == std::string::npos) throw InputError(where, "no '='", "pointer=value");
  const std::vector<std::string> keys = split_pointer(std::string_view(assignment).substr(0, equals), where);
  if (keys.empty()) throw InputError(where, "an empty pointer", "a pointer such as /skin/order");
  if (keys.front() == "extends") throw InputError(where, "/extends", "a key that can be set after extending");
  if (keys.size() > 64) throw InputError(where, std::to_string(keys.size()) + " keys", "a shorter pointer");

  const std::string text = assignment.substr(equals + 1);
  LocatedJson value;
  try {
    value = parse_located(text, "--set");
  } catch (const InputError&) {
    value.json = text;  // words and quantities need no quotes: --set /skin/rim=free
  }

  json* node = &target.json;
  const RuleNode* rule = &rules;
  std::string pointer;
  for (size_t i = 0; i < keys.size(); ++i) {
    std::string key = keys[i];
    const bool is_last = i + 1 == keys.size();
    const bool may_append = is_last && is_plain_list(rule);
    if (may_append && node->is_null()) *node = json::array();
    if (node->is_array()) {
      const size_t index = item_index(*node, key, where, pointer, may_append && !value.json.is_null());
      if (index == node->size()) node->push_back(nullptr);
      if (is_last && value.json.is_null()) {
        throw InputError(where, "null for an item of a list",
                         "a value (to drop an item, set the whole list)");
      }
      node = &(*node)[index];
      key = std::to_string(index);
      if (rule != nullptr) rule = rule->child("*");
    } else {
      if (node->is_null()) *node = json::object();
      if (value.json.is_null() && node->is_object() && !node->contains(key)) return;  // nothing to remove
      if (!node->is_object())
        throw InputError(where,
                         shown_json(*node) + " at " + (pointer.empty() ? "the root" : shown_text(pointer)),
                         "an object or a list there");
      if (is_last && value.json.is_null()) {
        node->erase(key);
        forget(target, pointer + "/" + escape_key(key));
        return;
      }
      node = &(*node)[key];
      if (rule != nullptr) rule = rule->child(key);
    }
    pointer += "/" + escape_key(key);
    if (!target.origin.contains(pointer)) target.origin[pointer] = origin;
  }
  *node = value.json;
  if (rule != nullptr) resolve_paths(*node, *rule, fs::path());
  forget(target, pointer);
  target.origin[pointer] = origin;
}

}  // namespace rhytid
