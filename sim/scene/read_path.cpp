#include "sim/scene/read_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/scene/located_json.h"

namespace rhytid {
namespace {

constexpr std::array<const char*, 8> kColumns{"time", "x", "y", "z", "qw", "qx", "qy", "qz"};

/// Columns of deviations, which a fit reads (fitting/path_deviations.h) and a simulation does not need.
bool is_deviation(const std::string& cell) {
  const auto has_name = [&cell](const std::string& name) {
    return cell == name || cell == name + "_mm" || cell == name + "_mm2";
  };
  for (const char* axis : {"x", "y", "z"})
    if (has_name(std::string("sigma_") + axis)) return true;
  for (const char* prefix : {"own_", "shared_"})
    for (const char* axes : {"xx", "xy", "xz", "yy", "yz", "zz"})
      if (has_name(std::string(prefix) + axes)) return true;
  return false;
}

/// What is no part of the path.
constexpr std::size_t kPassedOver = kColumns.size();

/// Which of kColumns each column of the file is.
std::vector<std::size_t> read_header(const CsvLine& line) {
  std::vector<std::size_t> meaning;
  for (std::string cell : line.cells) {
    if (is_deviation(cell)) {
      meaning.push_back(kPassedOver);
      continue;
    }
    if (cell == "time_s") cell = "time";
    if (cell.size() == 4 && cell.ends_with("_mm")) cell = cell.substr(0, 1);
    const auto found = std::find(kColumns.begin(), kColumns.end(), cell);
    if (found == kColumns.end())
      throw InputError(line.place, "column " + shown_text(cell),
                       "a header time,x,y,z or time,x,y,z,qw,qx,qy,qz");
    meaning.push_back(static_cast<std::size_t>(found - kColumns.begin()));
  }
  std::vector<std::size_t> sorted = meaning;
  std::erase(sorted, kPassedOver);
  std::sort(sorted.begin(), sorted.end());
  const bool is_whole = sorted.size() == 4 || sorted.size() == 8;
  for (std::size_t k = 0; k < sorted.size(); ++k)
    if (!is_whole || sorted[k] != k)
      throw InputError(line.place, shown_text(line.text), "a header time,x,y,z or time,x,y,z,qw,qx,qy,qz");
  return meaning;
}

/// Axis times angle of a rotation, at most half a turn, rad.
Vec3 rotation_vector(const Eigen::Quaterniond& q) {
  const double sine = q.vec().norm();
  if (sine < 1e-300) return Vec3::Zero();
  return 2 * std::atan2(sine, std::fabs(q.w())) / std::copysign(sine, q.w()) * q.vec();
}

}  // namespace

std::vector<PathKnot> read_path(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file, "a file that cannot be read", "a readable path (CSV)");
  if (std::filesystem::is_directory(file)) throw InputError(file, "a folder", "a path (CSV)");
  std::vector<PathKnot> knots;
  std::vector<std::size_t> meaning;
  for_csv_lines(in, file, [&](const CsvLine& line) {
    if (meaning.empty()) {
      meaning = read_header(line);
      return;
    }
    require_cells_as_in_header(line, meaning.size());
    std::array<double, kPassedOver + 1> value{0, 0, 0, 0, 1, 0, 0, 0, 0};
    for (std::size_t k = 0; k < line.cells.size(); ++k)
      value[meaning[k]] = csv_number(line.cells[k], line.place);
    const Eigen::Quaterniond q(value[4], value[5], value[6], value[7]);
    if (!(std::fabs(q.norm() - 1) <= 0.01))
      throw InputError(line.place, "a quaternion of length " + std::to_string(q.norm()), "length 1");
    if (!knots.empty() && value[0] <= knots.back().time)
      throw InputError(line.place, "time " + std::to_string(value[0]) + " s",
                       "a time later than that before");
    knots.push_back({value[0], Vec3(value[1], value[2], value[3]), rotation_vector(q)});
  });
  if (knots.empty()) throw InputError(file, "no knots", "a header and at least one line of numbers");
  return knots;
}

}  // namespace rhytid
