#include "tools/study/comparison.h"

#include "sim/scene/located_json.h"

namespace rhytid::tools {

using nlohmann::json;

std::vector<Rule> comparison_rules() {
  std::vector<Rule> rules = {
      {.pointer = "/compare",
       .type = RuleType::object,
       .doc = "What `bench pareto` compares: errors against run time."},
      {.pointer = "/compare/window",
       .type = RuleType::object,
       .is_required = true,
       .doc = "A rectangle on the surface at rest: material points whose displacements are compared."},
  };
  for (Rule& rule : surface_window_rules("/compare/window")) rules.push_back(std::move(rule));
  for (Rule rule : std::vector<Rule>{
           {.pointer = "/compare/parameters",
    .type = RuleType::array,
    .fallback = json::array(),
    .doc = "Addresses by which the mean square displacement of these points in the last frame is "
           "differentiated; none: no derivatives."},
           {.pointer = "/compare/parameters/*", .type = RuleType::string, .doc = "One address."},
           {.pointer = "/compare/groups",
           .type = RuleType::array,
           .is_required = true,
           .min = 1,
           .doc = "What is compared with what."},
           {.pointer = "/compare/groups/*", .type = RuleType::object, .doc = "One comparison."},
           {.pointer = "/compare/groups/*/name",
           .type = RuleType::name,
           .is_required = true,
           .doc = "Unique; begins the names of its plots: letters, digits, _ - + and dots."},
           {.pointer = "/compare/groups/*/reference",
           .type = RuleType::name,
           .is_required = true,
           .doc = "The variant that counts as the truth, finer than the others."},
           {.pointer = "/compare/groups/*/variants",
           .type = RuleType::array,
           .is_required = true,
           .min = 1,
           .doc = "Those compared with it; what is not run at the size asked for is left out."},
           {.pointer = "/compare/groups/*/variants/*", .type = RuleType::name, .doc = "One variant."},
       })
    rules.push_back(std::move(rule));
  return rules;
}

void check_comparison(const json& compare, const std::set<std::string>& variants, const RefuseValue& refuse) {
  check_surface_window(compare["window"], "/compare/window", refuse);
  std::set<std::string> seen;
  for (std::size_t i = 0; i < compare["groups"].size(); ++i) {
    const json& group = compare["groups"][i];
    const std::string at = "/compare/groups/" + std::to_string(i), name = group["name"];
    if (!seen.insert(name).second)
      refuse(at + "/name", shown_json(name) + " a second time", "a name of its own for each");
    if (name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+.") !=
        std::string::npos)
      refuse(at + "/name", shown_json(name), "letters, digits, _ - + and dots");
    if (variants.count(group["reference"]) == 0)
      refuse(at + "/reference", shown_json(group["reference"]), "the name of a variant");
    for (std::size_t k = 0; k < group["variants"].size(); ++k)
      if (variants.count(group["variants"][k]) == 0 || group["variants"][k] == group["reference"])
        refuse(at + "/variants/" + std::to_string(k), shown_json(group["variants"][k]),
               "the name of a variant, not the reference");
  }
}

Comparison read_comparison(const json& compare, const std::set<std::string>& run) {
  Comparison c;
  c.window = surface_window(compare["window"]);
  c.spacing = compare["window"]["spacing"];
  c.parameters = compare["parameters"].get<std::vector<std::string>>();
  for (const json& j : compare["groups"]) {
    ComparisonGroup group{j["name"], j["reference"], {}};
    for (const std::string name : j["variants"])
      if (run.count(name) > 0) group.variants.push_back(name);
    if (run.count(group.reference) > 0 && !group.variants.empty()) c.groups.push_back(std::move(group));
  }
  c.depends_on = {{"window", compare["window"]}, {"parameters", compare["parameters"]}};
  return c;
}

}  // namespace rhytid::tools
