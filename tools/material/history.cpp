#include "tools/material/history.h"

#include <Eigen/LU>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <vector>

#include "sim/core/error.h"

namespace rhytid::tools {

namespace {

std::string trimmed(const std::string& s) {
  const auto first = s.find_first_not_of(" \t\r"), last = s.find_last_not_of(" \t\r");
  return first == std::string::npos ? "" : s.substr(first, last - first + 1);
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(trimmed(cell));
  if (!line.empty() && line.back() == ',') cells.emplace_back();
  return cells;
}

/// What a column sets: −1 the time, 0..8 an entry of F, 9..11 a stretch.
int column_meaning(const std::string& cell, const std::string& where) {
  if (cell == "time" || cell == "time_s") return -1;
  if (cell.size() == 3 && cell[0] == 'F' && cell[1] >= '1' && cell[1] <= '3' && cell[2] >= '1' &&
      cell[2] <= '3')
    return 3 * (cell[1] - '1') + cell[2] - '1';
  if (cell == "stretch1" || cell == "stretch2" || cell == "stretch3") return 9 + cell[7] - '1';
  throw InputError(where, "column '" + cell + "'", "time_s, F11 to F33, or stretch1 to stretch3");
}

double number(const std::string& cell, const std::string& where) {
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value))
    throw InputError(where, "'" + cell + "'", "a finite number");
  return value;
}

}  // namespace

MaterialProgram parse_material_history(const std::string& text, const std::string& name) {
  MaterialProgram program;
  std::vector<int> meaning;
  std::istringstream in(text);
  std::string line;
  for (int count = 1; std::getline(in, line); ++count) {
    const std::string where = name + ":" + std::to_string(count);
    if (trimmed(line).empty() || trimmed(line)[0] == '#') continue;
    const std::vector<std::string> cells = cells_of(line);
    if (meaning.empty()) {
      for (const std::string& c : cells) meaning.push_back(column_meaning(c, where));
      const auto has = [&](int m) { return std::count(meaning.begin(), meaning.end(), m); };
      int entries = 0, stretches = 0;
      for (int m = -1; m < 12; ++m) {
        if (has(m) > 1) throw InputError(where, "a column twice", "every column once");
        (m >= 9 ? stretches : entries) += m >= 0 ? static_cast<int>(has(m)) : 0;
      }
      if (has(-1) == 0) throw InputError(where, "no time_s", "a column time_s");
      if (!(entries == 9 && stretches == 0) && !(entries == 0 && stretches > 0))
        throw InputError(
            where, std::to_string(entries) + " entries of F and " + std::to_string(stretches) + " stretches",
            "all nine entries F11 to F33, or one to three stretches");
      for (int k = 0; k < 3; ++k)
        program.traction_free[static_cast<std::size_t>(k)] = entries == 0 && has(9 + k) == 0;
      continue;
    }
    if (cells.size() != meaning.size())
      throw InputError(where, std::to_string(cells.size()) + " cells",
                       std::to_string(meaning.size()) + " as in the header");
    Mat3 f = Mat3::Identity();
    double time = 0, product = 1;
    int prescribed = 0;
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const double value = number(cells[k], where);
      if (meaning[k] < 0) {
        time = value;
      } else if (meaning[k] < 9) {
        f(meaning[k] / 3, meaning[k] % 3) = value;
      } else {
        if (!(value > 0)) throw InputError(where, cells[k], "a stretch > 0");
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
