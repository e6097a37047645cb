// What `bench pareto` compares: the key `compare` of an experiment file.
#pragma once

#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "tools/study/surface_window.h"

namespace rhytid::tools {

/// Variants whose errors are those against one of them, which is finer.
struct ComparisonGroup {
  std::string name, reference;
  std::vector<std::string> variants;  ///< without the reference
};

struct Comparison {
  SampleWindow window;                  ///< material points whose displacements are compared
  double spacing = 0;                   ///< mm, between them
  std::vector<std::string> parameters;  ///< addresses by which a functional is differentiated
  std::vector<ComparisonGroup> groups;
  nlohmann::json depends_on;  ///< what of this the result of a variant depends on
};

/// The rules of `compare`.
std::vector<Rule> comparison_rules();

/// What no single rule can say: groups compare variants that there are, each with another one.
void check_comparison(const nlohmann::json& compare, const std::set<std::string>& variants,
                      const RefuseValue& refuse);

/// Reads it; variants that are not among those that are run are left out, and so are groups without any or
/// without their reference.
Comparison read_comparison(const nlohmann::json& compare, const std::set<std::string>& run);

}  // namespace rhytid::tools
