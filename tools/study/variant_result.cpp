#include "tools/study/variant_result.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <sstream>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/located_json.h"

namespace rhytid::tools {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using NumberTable = std::vector<std::pair<std::string, std::vector<double>>>;

const std::vector<double>* find(const NumberTable& table, const std::string& name) {
  for (const auto& [column, values] : table)
    if (column == name) return &values;
  return nullptr;
}

/// "time_s" -> {"time", "s"}: the units that the tables of a run use.
ResultColumn split_unit(const std::string& header, double value) {
  for (const char* unit : {"mm2", "mm", "mJ", "deg", "N", "s"}) {
    const std::string ending = std::string("_") + unit;
    if (header.ends_with(ending)) return {header.substr(0, header.size() - ending.size()), unit, value};
  }
  return {header, "", value};
}

/// A number at a pointer, or nothing.
std::optional<double> number_at(const json& j, const std::string& pointer) {
  const json::json_pointer at(pointer);
  if (!j.contains(at) || !j[at].is_number()) return std::nullopt;
  return j[at].get<double>();
}

}  // namespace

std::string difference(const VariantIdentity& now, const VariantIdentity& then) {
  // In this order: another scene is another model, whatever the files.
  if (now.scene != then.scene) return "settings";
  if (now.measure != then.measure) return "measure";
  if (now.files != then.files) return "files";
  return now.program != then.program ? "program" : "";
}

NumberTable read_number_table(const std::string& path) {
  std::istringstream lines(read_file(path));
  NumberTable table;
  for_csv_lines(lines, path, [&table](const CsvLine& line) {
    if (table.empty()) {
      for (const std::string& cell : line.cells) table.push_back({cell, {}});
      return;
    }
    require_cells_as_in_header(line, table.size());
    for (std::size_t k = 0; k < table.size(); ++k) {
      double value = 0;
      if (!parse(line.cells[k], value))
        throw InputError(line.place, shown_json(line.cells[k]), "a number for " + table[k].first);
      table[k].second.push_back(value);
    }
  });
  if (table.empty()) throw InputError(path + ": empty");
  return table;
}

std::optional<VariantResult> read_variant(const std::string& folder) {
  const std::string path = folder + "/variant.json";
  if (!std::filesystem::exists(path)) return std::nullopt;
  const json j = json::parse(read_file(path), nullptr, false);
  if (!j.is_object() || !j.contains("columns")) return std::nullopt;
  VariantResult r;
  try {
    r.name = j.at("name"), r.status = j.at("status"), r.reason = j.at("reason");
    const json& identity = j.at("identity");
    r.identity = {identity.at("scene"), identity.at("measure"), identity.at("files"), identity.at("program")};
    for (const json& c : j.at("columns")) {
      ResultColumn column{c.at("name"), c.at("unit"), std::nullopt};
      if (c.at("value").is_number()) column.value = c.at("value").get<double>();
      r.columns.push_back(std::move(column));
    }
  } catch (const json::exception&) {
    return std::nullopt;
  }
  return r;
}

void write_variant(const std::string& folder, const VariantResult& result) {
  ordered_json j = {{"name", result.name},
                    {"identity",
                     {{"scene", result.identity.scene},
                      {"measure", result.identity.measure},
                      {"files", result.identity.files},
                      {"program", result.identity.program}}},
                    {"status", result.status},
                    {"reason", result.reason},
                    {"columns", ordered_json::array()}};
  for (const ResultColumn& c : result.columns)
    j["columns"].push_back(
        {{"name", c.name}, {"unit", c.unit}, {"value", c.value ? ordered_json(*c.value) : ordered_json()}});
  write_file(folder + "/variant.json", j.dump(2) + "\n");
}

bool is_of_run(const std::string& folder) {
  if (std::filesystem::exists(folder + "/run.json")) return true;
  const auto result = read_variant(folder);
  return result && !result->finished();  // a plan keeps nothing of a swipe before its end
}

bool is_of_plan(const std::string& folder) {
  const auto result = read_variant(folder);
  return result && result->finished() &&
         (result->columns.empty() || result->columns.front().name.starts_with("root_"));
}

std::vector<ResultColumn> read_results(const std::string& folder) {
  std::vector<ResultColumn> columns;
  const json run = json::parse(read_file(folder + "/run.json"));
  for (const char* count : {"faces", "nodes", "unknowns"})
    columns.push_back({count, "", number_at(run, std::string("/sizes/") + count)});
  columns.push_back({"frames", "", number_at(run, "/progress/frames_done")});
  // A resumed run knows only its own time.
  const bool resumed = number_at(run, "/progress/resumed_from_frame").has_value();
  columns.push_back({"solve_cpu", "s", resumed ? std::nullopt : number_at(run, "/timings_s/solve_cpu")});

  const std::string steps_file = folder + "/steps.csv";
  if (std::filesystem::exists(steps_file)) {
    const NumberTable steps = read_number_table(steps_file);
    if (!steps.empty() && !steps[0].second.empty()) {
      columns.push_back({"steps", "", static_cast<double>(steps[0].second.size())});
      for (const char* name : {"iterations", "evaluations", "factorisations"})
        if (const auto* v = find(steps, name))
          columns.push_back({name, "", std::accumulate(v->begin(), v->end(), 0.)});
      if (const auto* v = find(steps, "stored_energy_mJ"))
        columns.push_back({"stored_energy", "mJ", v->back()});
      if (const auto* v = find(steps, "dissipated_energy_mJ"))
        columns.push_back({"dissipated_energy", "mJ", v->back()});
      if (const auto* v = find(steps, "min_J"))
        columns.push_back({"min_J", "", *std::min_element(v->begin(), v->end())});
      for (const auto& [header, values] : steps)
        if (header.starts_with("max_displacement") || header.starts_with("force_") ||
            header.starts_with("penetration_"))
          columns.push_back(split_unit(header, values.back()));
    }
  }
  const std::string wrinkles_file = folder + "/wrinkles.csv";
  if (std::filesystem::exists(wrinkles_file))
    for (const auto& [header, values] : read_number_table(wrinkles_file))
      if (header != "frame" && header != "time_s" && !values.empty())
        columns.push_back(split_unit(header, values.back()));
  return columns;
}

}  // namespace rhytid::tools
