#include "tools/study/parameter_sets.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <set>
#include <sstream>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/scene/located_json.h"
#include "tools/verb.h"

namespace rhytid::tools {
namespace {

constexpr std::size_t kMostRuns = 100000;

std::string numbered(std::size_t i) {
  char text[24];
  std::snprintf(text, sizeof text, "%04zu", i + 1);
  return text;
}

/// The keys of a pointer, items of lists by number. Those that the scene has not stay as they are.
std::vector<std::string> resolved_keys(const nlohmann::json& scene, const std::string& pointer) {
  std::vector<std::string> keys = split_pointer(pointer, pointer);
  const nlohmann::json* node = &scene;
  for (std::string& key : keys) {
    if (node == nullptr) break;
    if (node->is_array()) {
      int index = -1;
      const char* const end = key.data() + key.size();
      if (const auto read = std::from_chars(key.data(), end, index);
          read.ec != std::errc() || read.ptr != end)
        index = find_named(*node, key);
      if (index >= 0) key = std::to_string(index);
      node = index >= 0 && index < static_cast<int>(node->size()) ? &(*node)[static_cast<std::size_t>(index)]
                                                                  : nullptr;
    } else {
      node = node->is_object() && node->contains(key) ? &(*node)[key] : nullptr;
    }
  }
  return keys;
}

/// Whether the keys are the same as far as the shorter goes.
bool overlap(const std::vector<std::string>& a, const std::vector<std::string>& b) {
  return std::equal(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(std::min(a.size(), b.size())),
                    b.begin());
}

}  // namespace

std::vector<ParameterSet> grid_sets(const std::vector<std::string>& axes) {
  std::vector<ParameterSet> sets(1);
  std::set<std::string> seen;
  for (const std::string& axis : axes) {
    const std::size_t equals = axis.find('=');
    const std::string address = axis.substr(0, equals);
    if (equals == std::string::npos || address.size() < 2 || address[0] != '/')
      throw InputError("--grid", "'" + axis + "'", "/json/pointer=value,value,...");
    if (!seen.insert(address).second)
      throw InputError("--grid", address + " a second time", "all its values in one --grid");
    std::vector<std::string> values;
    std::istringstream cells(axis.substr(equals + 1));
    for (std::string cell; std::getline(cells, cell, ',');) values.push_back(trimmed(cell));
    if (values.empty() || axis.back() == ',' ||
        std::any_of(values.begin(), values.end(), [](const std::string& v) { return v.empty(); }))
      throw InputError("--grid", "'" + axis + "'",
                       "a value between all commas of " + address + "=value,value,...");
    if (sets.size() * values.size() > kMostRuns)
      throw InputError("--grid", "more than " + std::to_string(kMostRuns) + " runs", "fewer values");
    std::vector<ParameterSet> finer;
    for (const ParameterSet& set : sets)
      for (const std::string& value : values) {
        finer.push_back(set);
        finer.back().values.push_back({address, value});
      }
    sets = std::move(finer);
  }
  for (std::size_t i = 0; i < sets.size(); ++i) sets[i].name = numbered(i), sets[i].origin = "--grid";
  return sets;
}

std::vector<ParameterSet> table_sets(const std::string& path) {
  std::istringstream lines(read_file(path));
  std::vector<std::string> header;
  std::vector<ParameterSet> sets;
  std::set<std::string> names;
  for_csv_lines(lines, path, [&](const CsvLine& line) {
    if (header.empty()) {
      header = line.cells;
      for (std::size_t k = 0; k < header.size(); ++k) {
        if (header[k] != "name" && !header[k].starts_with('/'))
          throw InputError(line.place, shown_json(header[k]), "an address as /skin/order, or name");
        if (std::find(header.begin(), header.begin() + static_cast<std::ptrdiff_t>(k), header[k]) !=
            header.begin() + static_cast<std::ptrdiff_t>(k))
          throw InputError(line.place, header[k] + " a second time", "each column once");
      }
      if (header == std::vector<std::string>{"name"})
        throw InputError(line.place, "no address", "a column of values at least, as /skin/order");
      return;
    }
    require_cells_as_in_header(line, header.size());
    ParameterSet set{numbered(sets.size()), {}, line.place};
    for (std::size_t k = 0; k < header.size(); ++k) {
      if (line.cells[k].empty()) throw InputError(line.place, "an empty cell", "a value for " + header[k]);
      if (header[k] != "name") {
        set.values.push_back({header[k], line.cells[k]});
        continue;
      }
      set.name = line.cells[k];
      check_variant_name(set.name, line.place);
    }
    if (!names.insert(set.name).second)
      throw InputError(line.place, shown_json(set.name) + " a second time", "a name of its own for each run");
    sets.push_back(std::move(set));
    if (sets.size() > kMostRuns)
      throw InputError(line.place, "more than " + std::to_string(kMostRuns) + " runs", "fewer rows");
  });
  if (sets.empty()) throw InputError(path, "no rows", "a header with addresses and a row per run");
  return sets;
}

Experiment experiment_of_scene(const std::string& path) {
  Experiment e;
  e.file = e.scene = path;
  e.name = name_of_file(path);
  e.measure_json = nlohmann::json::object();
  e.variants.push_back({"", {}, {}});
  return e;
}

Experiment with_parameter_sets(const Experiment& experiment, const std::vector<ParameterSet>& sets) {
  Experiment swept = experiment;
  swept.variants.clear();
  std::set<std::string> names;  // of folders
  for (const Variant& v : experiment.variants)
    for (const ParameterSet& set : sets) {
      Variant run = v;
      run.name = v.name.empty() ? set.name : v.name + "." + set.name;
      run.values = set.values;
      for (const SweptValue& value : set.values)
        run.settings.push_back({value.address + "=" + value.text, set.origin});
      if (!names.insert(run.name).second)
        throw InputError(set.origin, "two runs called '" + run.name + "'",
                         "names that differ when joined by a dot");
      check_variant_name(run.name, set.origin);
      swept.variants.push_back(std::move(run));
    }
  return swept;
}

void check_swept_values(const Experiment& experiment, const Variant& run,
                        const std::vector<std::string>& command_line) {
  std::vector<Setting> settings = run.settings;
  for (const std::string& text : command_line) settings.push_back({text});
  const std::size_t first = run.settings.size() - run.values.size();  // those of the sweep come last
  LocatedJson scene = read_with_extends(experiment.scene);
  std::vector<std::vector<std::string>> swept;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const std::string address = settings[i].text.substr(0, settings[i].text.find('='));
    if (i >= first) {
      // Before it is applied: it may itself change names.
      const std::vector<std::string> keys = resolved_keys(scene.json, address);
      for (std::size_t k = 0; k < swept.size(); ++k) {
        if (!overlap(keys, swept[k])) continue;
        const std::string& other = run.values[k].address;
        if (i < run.settings.size())
          throw InputError(settings[i].origin, address + ", of which " + other + " sets a part or the whole",
                           "addresses of different values");
        throw InputError("--set", settings[i].text + ", which the sweep sets in every run as " + other,
                         "another address");
      }
      if (i < run.settings.size()) swept.push_back(keys);
    }
    apply_override(scene, settings[i], experiment.scene);
  }
}

}  // namespace rhytid::tools
