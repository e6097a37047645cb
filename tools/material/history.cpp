#include "tools/material/history.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"

namespace rhytid::tools {

namespace {

/// What a column sets: −1 the time, 0..8 an entry of F, 9..11 a stretch.
int column_meaning(const std::string& cell, const std::string& where) {
  if (cell == "time" || cell == "time_s") return -1;
  if (cell.size() == 3 && cell[0] == 'F' && cell[1] >= '1' && cell[1] <= '3' && cell[2] >= '1' &&
      cell[2] <= '3')
    return 3 * (cell[1] - '1') + cell[2] - '1';
  if (cell == "stretch1" || cell == "stretch2" || cell == "stretch3") return 9 + cell[7] - '1';
  throw InputError(where, "column '" + cell + "'", "time_s, F11 to F33, or stretch1 to stretch3");
}

/// Columns of numbers, each row with the place it comes from.
struct HistoryTable {
  std::string header_place;
  std::vector<std::string> names;
  std::vector<std::string> places;         ///< [rows]
  std::vector<std::vector<double>> cells;  ///< [rows][columns]
};

HistoryTable read_csv(const std::string& text, const std::string& name) {
  HistoryTable table;
  std::istringstream in(text);
  for_csv_lines(in, name, [&](const CsvLine& line) {
    if (table.names.empty()) {
      table.names = line.cells;
      table.header_place = line.place;
      return;
    }
    require_cells_as_in_header(line, table.names.size());
    table.places.push_back(line.place);
    table.cells.emplace_back();
    for (const std::string& cell : line.cells) table.cells.back().push_back(csv_number(cell, line.place));
  });
  return table;
}

HistoryTable read_json(const std::string& text, const std::string& name) {
  const nlohmann::json root = nlohmann::json::parse(text, nullptr, false);
  const auto is_list_of_numbers = [](const nlohmann::json& list) {
    return list.is_array() &&
           std::all_of(list.begin(), list.end(), [](const nlohmann::json& x) { return x.is_number(); });
  };
  if (!root.is_object())
    throw InputError(name, "something else",
                     "a JSON object of lists, {\"time_s\": [...], \"stretch1\": [...]}");
  HistoryTable table;
  table.header_place = name;
  std::size_t rows = 0;
  for (const auto& [key, list] : root.items()) {
    if (!is_list_of_numbers(list)) throw InputError(name + ": " + key, "something else", "a list of numbers");
    if (!table.names.empty() && list.size() != rows)
      throw InputError(name + ": " + key, std::to_string(list.size()) + " numbers",
                       std::to_string(rows) + " as in " + table.names[0]);
    rows = list.size();
    table.names.push_back(key);
    table.cells.resize(rows);
    for (std::size_t i = 0; i < rows; ++i) table.cells[i].push_back(list[i].get<double>());
  }
  for (std::size_t i = 0; i < rows; ++i) table.places.push_back(name + ": row " + std::to_string(i));
  return table;
}

/// Meaning of every column; fills which directions are free.
std::vector<int> column_meanings(const HistoryTable& table, MaterialProgram& program) {
  std::vector<int> meaning;
  for (const std::string& c : table.names) meaning.push_back(column_meaning(c, table.header_place));
  const auto has = [&](int m) { return std::count(meaning.begin(), meaning.end(), m); };
  int entries = 0, stretches = 0;
  for (int m = -1; m < 12; ++m) {
    if (has(m) > 1) throw InputError(table.header_place, "a column twice", "every column once");
    (m >= 9 ? stretches : entries) += m >= 0 ? static_cast<int>(has(m)) : 0;
  }
  if (has(-1) == 0) throw InputError(table.header_place, "no time_s", "a column time_s");
  if (!(entries == 9 && stretches == 0) && !(entries == 0 && stretches > 0))
    throw InputError(
        table.header_place,
        std::to_string(entries) + " entries of F and " + std::to_string(stretches) + " stretches",
        "all nine entries F11 to F33, or one to three stretches");
  for (int k = 0; k < 3; ++k)
    program.traction_free[static_cast<std::size_t>(k)] = entries == 0 && has(9 + k) == 0;
  return meaning;
}

}  // namespace

MaterialProgram parse_material_history(const std::string& text, const std::string& name) {
  const bool is_json = name.ends_with(".json");
  const HistoryTable table = is_json ? read_json(text, name) : read_csv(text, name);
  if (table.names.empty()) throw InputError(name, "no rows", "a header and at least one row");
  MaterialProgram program;
  const std::vector<int> meaning = column_meanings(table, program);
  for (std::size_t row = 0; row < table.cells.size(); ++row) {
    const std::string& where = table.places[row];
    Mat3 f = Mat3::Identity();
    double time = 0, product = 1;
    int prescribed = 0;
    for (std::size_t k = 0; k < meaning.size(); ++k) {
      const double value = table.cells[row][k];
      if (meaning[k] < 0) {
        time = value;
      } else if (meaning[k] < 9) {
        f(meaning[k] / 3, meaning[k] % 3) = value;
      } else {
        if (!(value > 0)) throw InputError(where, std::to_string(value), "a stretch > 0");
        f(meaning[k] - 9, meaning[k] - 9) = value;
        product *= value;
        ++prescribed;
      }
    }
    // Guess of the free stretches: constant volume.
    for (int k = 0; k < 3; ++k)
      if (program.traction_free[static_cast<std::size_t>(k)])
        f(k, k) = std::pow(product, -1.0 / (3 - prescribed));
    if (!(f.determinant() > 0))
      throw InputError(where, "det F = " + std::to_string(f.determinant()), "det F > 0");
    if (!program.times.empty() && time < program.times.back())
      throw InputError(where, "time " + std::to_string(time) + " s", "times that do not fall");
    program.times.push_back(time);
    program.deformation.push_back(f);
  }
  if (program.times.empty()) throw InputError(name, "no rows", "a header and at least one row");
  return program;
}

}  // namespace rhytid::tools
