// The one table of what a scene file may say. Validation, defaults, the JSON Schema and the documentation are
// all computed from it; adding a key means one row here and one line in fields.h. Other files (cases) bring a
// table of their own to the same machinery.
#pragma once

#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sim/core/units.h"

namespace rhytid {

enum class RuleType {
  object,
  array,
  number,    ///< a finite number, or a string with a unit of the right dimension
  quantity,  ///< the same of any dimension; who reads it checks, since it depends on other values
  integer,   ///< 3 and 3.0, not 3.5
  string,
  name,  ///< of a list item: not empty, not only digits, without / ~ = and control characters
  path,  ///< of a file, resolved against the file that mentions it
  boolean,
  option,     ///< one of a list of words
  vector2,    ///< two numbers
  vector3,    ///< three numbers
  integers2,  ///< two integers
};

struct Rule {
  std::string pointer;  ///< JSON pointer with * for the items of an array
  RuleType type = RuleType::number;
  Dimension dimension = dimension::none;  ///< of numbers and of vector components
  nlohmann::json fallback = nullptr;      ///< value when the key is absent; null: the key stays absent
  bool is_required = false;
  /// Range of a number, of each vector component, or of the length of an array, in internal units.
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool min_is_open = false, max_is_open = false;  ///< the bound itself is refused
  std::vector<std::string> options{};             ///< of RuleType::option
  std::string rival{};             ///< sibling key that must not be given together with this one
  bool needs_one_of_pair = false;  ///< exactly one of this key and its rival must be given
  std::string needs{};             ///< sibling key without which this one has no meaning
  std::string doc{};
};

/// All rules, parents before children, in the order of the documentation. The root has the pointer "".
const std::vector<Rule>& scene_rules();

struct RuleEntry;

/// The rules as a tree.
struct RuleNode {
  const Rule* rule = nullptr;
  std::vector<RuleEntry> children;  ///< of an object by key; of an array one, "*"

  /// Child for a key, or null.
  const RuleNode* child(std::string_view key) const;
  /// Whether this is an array whose items have names, so that an address may use them in place of numbers.
  bool is_named_list() const;
};
/// A child and its key.
struct RuleEntry {
  std::string key;
  RuleNode node;
};
/// The tree of a table, parents before children. The rules must outlive it.
RuleNode build_rule_tree(const std::vector<Rule>& rules);
const RuleNode& scene_rule_tree();

/// The rule for a pattern such as "/skin/layers/*/thickness", or null.
const Rule* find_rule(std::string_view pattern);

/// What a rule accepts, as the end of the sentence "expected ...": "a length > 0 mm", "an integer from 1 to
/// 4".
std::string expectation(const Rule& rule);

/// The range alone: "> 0 mm", "from 1 to 4", "" without bounds.
std::string range_text(const Rule& rule);

/// Whether `value` (internal units) lies in the range of `rule`.
bool is_in_range(const Rule& rule, double value);

}  // namespace rhytid
