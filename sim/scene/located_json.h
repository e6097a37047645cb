// JSON text that remembers where each value was written, and the three ways a scene is put together from such
// texts: `extends` another file, merge patches, and --set overrides.
//
// Merging follows RFC 7386 (objects merge key by key, null removes a key, anything else replaces), with one
// addition: a list of named items (layers, sources, colliders) may be patched by an object keyed by name,
//   "layers": {"film": {"youngs_modulus": "8 MPa"}, "fat": null},
// which changes, appends or removes single items; a list [...] replaces the whole list, as in RFC 7386.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "sim/scene/rules.h"

namespace rhytid {

/// A change of a file, "pointer=value", that another file or the command line asks for.
struct Setting {
  std::string text;
  std::string origin = {};  ///< where it is written, for messages: "case.json:4: /settings/0"; empty: --set
};

struct LocatedJson {
  nlohmann::json json;
  std::map<std::string, std::string> origin;  ///< JSON pointer -> "file:line" of the value

  /// Origin of the value at `pointer`, or of the closest value around it.
  std::string where(std::string pointer) const;
};

/// Settings as --set gives them.
std::vector<Setting> of_command_line(const std::vector<std::string>& texts);
/// Those that a file lists at `pointer`; none when it lists none. Throws InputError for an item that is no
/// text.
std::vector<Setting> settings_at(const LocatedJson& located, const std::string& pointer);

/// A key as it stands in a JSON pointer: ~ -> ~0, / -> ~1.
std::string escape_key(std::string_view key);
/// The keys of a pointer, unescaped: "/a/b~1c" -> {"a", "b/c"}. Throws InputError (starting with `where`)
/// unless it is empty or starts with '/'.
std::vector<std::string> split_pointer(std::string_view pointer, const std::string& where);

/// Text for the middle of a message: control characters and broken UTF-8 escaped, shortened to about 200
/// bytes.
std::string shown_text(const std::string& text);
/// The value as compact JSON, shortened to about 60 characters, always one line of valid UTF-8.
std::string shown_json(const nlohmann::json& value);

/// Index of the item called `name` in a list of objects with names, or -1.
int find_named(const nlohmann::json& list, std::string_view name);

/// Parses JSON with comments. Throws InputError "file:line:column: ..." on syntax errors, keys given twice,
/// numbers beyond double range and nesting deeper than 64.
LocatedJson parse_located(std::string_view text, const std::string& file);

/// Merges `patch` into `target` as described above; `rules` say which lists have named items.
void merge(LocatedJson& target, const LocatedJson& patch, const RuleNode& rules = scene_rule_tree());

/// Reads a file, makes paths in it absolute, and merges it into the file that it extends, and so on.
/// `kind` is what messages call such a file. Throws InputError when a file cannot be read, is malformed or
/// extends itself.
LocatedJson read_with_extends(const std::string& path, const RuleNode& rules = scene_rule_tree(),
                              const std::string& kind = "scene");

/// Applies "pointer=value": value is JSON or, failing that, a string ("4 MPa"); null removes the value. List
/// items are addressed by number or by name; missing objects on the way are created. In a list of strings
/// the number behind the last appends. Messages about the value then name the setting's origin, or `file`
/// and --set.
void apply_override(LocatedJson& target, const Setting& setting, const std::string& file,
                    const RuleNode& rules = scene_rule_tree());

}  // namespace rhytid
