// Deformation histories of a material point as CSV, or as JSON with a list per column: {"time_s": [0, 0.1],
// ...}.
//
//   time_s, F11, F12, ..., F33                                  nine columns: all of F prescribed
//   time_s, stretch1[, stretch2[, stretch3]]                    the directions that are missing are
//   traction-free
//
// Columns in any order, others refused; lines that start with # and empty lines are skipped.
#pragma once

#include <string>

#include "sim/terms/material_point.h"

namespace rhytid::tools {

/// Parses the text of a history file; `name` is the file in messages, and JSON when it ends with .json.
/// Throws InputError naming file, line, value and what was expected.
MaterialProgram parse_material_history(const std::string& text, const std::string& name);

}  // namespace rhytid::tools
