#include "sim/output/csv.h"

#include <sstream>

#include "sim/core/csv_reader.h"
#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"

namespace rhytid {

namespace {

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + '"';
}

std::string cell_text(const CsvCell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) return exact_text(*number);
  if (const auto* count = std::get_if<std::int64_t>(&cell)) return std::to_string(*count);
  return quoted(std::get<std::string>(cell));
}

}  // namespace

CsvTable::CsvTable(std::vector<CsvColumn> columns) : num_columns_(columns.size()) {
  require(!columns.empty(), "CsvTable: no columns");
  for (const CsvColumn& column : columns) {
    if (&column != &columns.front()) text_ += ',';
    text_ += quoted(column.unit.empty() ? column.name : column.name + "_" + column.unit);
  }
  text_ += '\n';
}

void CsvTable::add_row(std::vector<CsvCell> cells) {
  require(cells.size() == num_columns_, "CsvTable: a row needs one cell per column");
  for (size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) text_ += ',';
    text_ += cell_text(cells[i]);
  }
  text_ += '\n';
  ++num_rows_;
}

void CsvTable::add_numbers(const std::vector<double>& values) {
  add_row(std::vector<CsvCell>(values.begin(), values.end()));
}

void CsvTable::restore(const std::string& text, const std::string& path,
                       const std::function<bool(const std::vector<double>&)>& wanted) {
  require(num_rows_ == 0, "CsvTable: only an empty table is restored");
  std::istringstream lines(text);
  std::string kept;
  size_t num_rows = 0;
  bool is_header = true, is_over = false;
  for_csv_lines(lines, path, [&](const CsvLine& line) {
    if (is_header) {
      if (line.text + "\n" != text_)
        throw InputError(line.place, "a table with other columns", "the one that the run wrote");
      is_header = false;
      return;
    }
    if (is_over) return;
    require_cells_as_in_header(line, num_columns_);
    std::vector<double> values(num_columns_);
    for (size_t k = 0; k < num_columns_; ++k)
      if (!parse(line.cells[k], values[k]))
        throw InputError(line.place, quoted(line.cells[k].substr(0, 40)), "a number");
    is_over = !wanted(values);
    if (is_over) return;
    kept += line.text + "\n";
    ++num_rows;
  });
  if (is_header) throw InputError(path, "an empty file", "the table that the run wrote");
  text_ += kept, num_rows_ = num_rows;
}

void CsvTable::write(const std::string& path) const {
  write_file(path, text_);
}

}  // namespace rhytid
