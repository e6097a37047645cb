#include "fitting/residual_table.h"

#include <charconv>
#include <sstream>
#include <string_view>
#include <type_traits>

#include "sim/core/error.h"
#include "sim/output/csv.h"

namespace rhytid::fitting {
namespace {

/// Of a fit of several clips or cameras the last two say, counted from 0 in the order of fit.json, which.
const std::vector<CsvColumn>& residual_columns(bool by_clips) {
  static const std::vector<CsvColumn> columns = {
      {"frame", ""},         {"track", ""},         {"x", "px"},    {"y", "px"},
      {"predicted_x", "px"}, {"predicted_y", "px"}, {"weight", ""},
  };
  static const std::vector<CsvColumn> with_clips = [] {
    std::vector<CsvColumn> all = columns;
    all.push_back({"clip", ""});
    all.push_back({"camera", ""});
    return all;
  }();
  return by_clips ? with_clips : columns;
}

}  // namespace

std::string residual_text(const FitResult& result) {
  const bool by_clips = !result.clips.empty();
  CsvTable table(residual_columns(by_clips));
  for (const FitResidual& r : result.residuals) {
    std::vector<CsvCell> row = {std::int64_t{r.frame}, std::int64_t{r.track}, r.x_px,  r.y_px,
                                r.predicted_x_px,      r.predicted_y_px,      r.weight};
    if (by_clips) row.insert(row.end(), {std::int64_t{r.clip}, std::int64_t{r.view}});
    table.add_row(std::move(row));
  }
  return table.text();
}

namespace {

template <class Number>
Number parse_cell(std::string_view cell, const std::string& where) {
  Number value{};
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size()) {
    throw InputError(where, "'" + std::string(cell) + "'",
                     std::is_integral_v<Number> ? "a whole number" : "a number");
  }
  return value;
}

}  // namespace

std::vector<FitResidual> parse_residuals(const std::string& text, const std::string& path,
                                         const FitResult& result) {
  const std::vector<CsvColumn>& columns = residual_columns(!result.clips.empty());
  std::istringstream lines(text);
  std::string line, header = CsvTable(columns).text();
  header.pop_back();
  if (!std::getline(lines, line) || line != header) throw InputError(path + ":1", "'" + line + "'", header);
  std::vector<FitResidual> residuals;
  for (int number = 2; std::getline(lines, line); ++number) {
    const std::string where = path + ":" + std::to_string(number);
    std::vector<std::string_view> cells;
    for (std::string_view rest = line;;) {
      const size_t comma = rest.find(',');
      cells.push_back(rest.substr(0, comma));
      if (comma == std::string_view::npos) break;
      rest.remove_prefix(comma + 1);
    }
    if (cells.size() != columns.size()) {
      throw InputError(where, std::to_string(cells.size()) + " cells", std::to_string(columns.size()));
    }
    const auto index = [&](size_t i, size_t size, const std::string& at) {
      const int found = parse_cell<int>(cells[i], at);
      if (found < 0 || found >= static_cast<int>(size))
        throw InputError(at, std::to_string(found), "a number below " + std::to_string(size));
      return found;
    };
    const auto real = [&](size_t i) { return parse_cell<double>(cells[i], where); };
    residuals.push_back({parse_cell<int>(cells[0], where), parse_cell<int>(cells[1], where), real(2), real(3),
                         real(4), real(5), real(6)});
    if (result.clips.empty()) continue;
    FitResidual& r = residuals.back();
    r.clip = index(7, result.clips.size(), where);
    r.view = index(8, result.clips[r.clip].views.size(), where);
  }
  return residuals;
}

}  // namespace rhytid::fitting
