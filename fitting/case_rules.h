// The table of what a case file may say, for the same machinery as scenes (sim/scene/rules.h). Defaults come
// from the structs of case.h.
#pragma once

#include "sim/scene/rules.h"

namespace rhytid::fitting {

/// All rules of case files, and as a tree.
const std::vector<Rule>& case_rules();
const RuleNode& case_rule_tree();

/// Those of /fit.
std::vector<Rule> fit_rules();

/// JSON Schema (draft 2020-12) of case files, for editors.
nlohmann::json case_schema();
/// The case format as Markdown.
std::string case_documentation();

}  // namespace rhytid::fitting
