// JSON Schema and Markdown of a file format, from its table of rules. Scenes use it, and whatever brings a
// table of its own. Tests: tests/sim/scene/scene_test.cpp, tests/fitting/case_test.cpp
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sim/scene/rules.h"

namespace rhytid {

/// JSON Schema (draft 2020-12), for editors: complete files, and files that extend another. `name` as in
/// "scene".
nlohmann::json format_schema(const RuleNode& rules, const std::string& name);

/// Every key, type, unit, range and default as Markdown tables below `introduction`, one section per object.
std::string format_documentation(const std::vector<Rule>& rules, const RuleNode& tree,
                                 const std::string& name, const std::string& introduction);

}  // namespace rhytid
