// Sweeps over sets of values: a full grid of some addresses, or a table with a row per run.
// Tests: tests/tools/parameter_sets_test.cpp
#pragma once

#include <string>
#include <vector>

#include "tools/study/experiment.h"

namespace rhytid::tools {

/// The values of one run.
struct ParameterSet {
  std::string name;
  std::vector<SweptValue> values;
  std::string origin;  ///< where it is written, for messages
};

/// All combinations of axes "ADDRESS=a,b,c", the last running fastest, named 0001, 0002, ... Throws
/// InputError for an axis that reads otherwise, an address given twice, or more than 100,000 runs.
std::vector<ParameterSet> grid_sets(const std::vector<std::string>& axes);

/// A row per run: the header has addresses ("/skin/layers/film/youngs_modulus") and maybe `name`; cells are
/// what
/// --set takes behind the =. Without names rows are 0001, 0002, ... Throws InputError naming file and line.
std::vector<ParameterSet> table_sets(const std::string& path);

/// A scene as an experiment of one variant without settings and without a measure. Throws InputError when the
/// file cannot be read.
Experiment experiment_of_scene(const std::string& path);

/// Every variant of the experiment with every set, named VARIANT.SET (SET alone for experiment_of_scene). Throws
/// InputError for two runs of one name, or one that no folder beside the tables can have.
Experiment with_parameter_sets(const Experiment& experiment, const std::vector<ParameterSet>& sets);

/// Throws InputError when a run would not have the values that the tables say it has: two addresses of the
/// sweep, or one and a setting of the command line, are the same value, or one holds the other. Items of lists
/// by name and by number are the same.
void check_swept_values(const Experiment& experiment, const Variant& run,
                        const std::vector<std::string>& command_line);

}  // namespace rhytid::tools
