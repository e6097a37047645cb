#include "sim/scene/read_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "sim/core/error.h"
#include "sim/scene/located_json.h"

namespace rhytid {
namespace {

constexpr std::array<const char*, 8> kColumns{"time", "x", "y", "z", "qw", "qx", "qy", "qz"};

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

/// Which of kColumns each column of the file is.
std::vector<std::size_t> read_header(const std::string& line, const std::string& where) {
  std::vector<std::size_t> meaning;
  for (std::string cell : cells_of(line)) {
    if (cell == "time_s") cell = "time";
    if (cell.size() == 4 && cell.ends_with("_mm")) cell = cell.substr(0, 1);
    const auto found = std::find(kColumns.begin(), kColumns.end(), cell);
    if (found == kColumns.end())
      throw InputError(where, "column " + shown_text(cell), "a header time,x,y,z or time,x,y,z,qw,qx,qy,qz");
    meaning.push_back(static_cast<std::size_t>(found - kColumns.begin()));
  }
  std::vector<std::size_t> sorted = meaning;
  std::sort(sorted.begin(), sorted.end());
  const bool is_whole = sorted.size() == 4 || sorted.size() == 8;
  for (std::size_t k = 0; k < sorted.size(); ++k)
    if (!is_whole || sorted[k] != k)
      throw InputError(where, shown_text(line), "a header time,x,y,z or time,x,y,z,qw,qx,qy,qz");
  return meaning;
}

double number(const std::string& cell, const std::string& where) {
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value))
    throw InputError(where, shown_text(cell), "a finite number");
  return value;
}

/// Axis times angle of a rotation, rad.
Vec3 rotation_vector(const Eigen::Quaterniond& q) {
  const double sine = q.vec().norm();
  if (sine < 1e-300) return Vec3::Zero();
  return 2 * std::atan2(sine, q.w()) / sine * q.vec();
}

}  // namespace

std::vector<PathKnot> read_path(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file, "a file that cannot be read", "a readable path (CSV)");
  std::vector<PathKnot> knots;
  std::vector<std::size_t> meaning;
  std::string line;
  for (int count = 1; std::getline(in, line); ++count) {
    const std::string where = file + ":" + std::to_string(count), text = trimmed(line);
    if (text.empty() || text[0] == '#') continue;
    if (meaning.empty()) {
      meaning = read_header(text, where);
      continue;
    }
    const std::vector<std::string> cells = cells_of(text);
    if (cells.size() != meaning.size())
      throw InputError(where, std::to_string(cells.size()) + " cells",
                       std::to_string(meaning.size()) + " as in the header");
    std::array<double, 8> value{0, 0, 0, 0, 1, 0, 0, 0};
    for (std::size_t k = 0; k < cells.size(); ++k) value[meaning[k]] = number(cells[k], where);
    const Eigen::Quaterniond q(value[4], value[5], value[6], value[7]);
    if (!(std::fabs(q.norm() - 1) <= 0.01))
      throw InputError(where, "a quaternion of length " + std::to_string(q.norm()), "length 1");
    if (!knots.empty() && value[0] <= knots.back().time)
      throw InputError(where, "time " + std::to_string(value[0]) + " s", "a time later than that before");
    knots.push_back({value[0], Vec3(value[1], value[2], value[3]), rotation_vector(q)});
  }
  if (knots.empty()) throw InputError(file, "no knots", "a header and at least one line of numbers");
  return knots;
}

}  // namespace rhytid
