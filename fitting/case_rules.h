// The table of what a case file may say, for the same machinery as scenes (sim/scene/rules.h). Defaults come
// from the structs of case.h.
#pragma once

#include "sim/scene/rules.h"

namespace rhytid::fitting {

/// All rules of case files as a tree.
const RuleNode& case_rule_tree();

}  // namespace rhytid::fitting
