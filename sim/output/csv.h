// Tables of results: comma-separated, one header row with units, full precision, locale-independent.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

namespace rhytid {

struct CsvColumn {
  std::string name;  ///< e.g. "time"
  std::string unit;  ///< e.g. "s": the header says "time_s"; empty for counts, names and ratios
};

using CsvCell = std::variant<double, std::int64_t, std::string>;

/// A table held in memory and written whole and atomically, as often as wanted (e.g. after every frame).
/// Doubles read back bit-identically; text with commas, quotes or line breaks is quoted (RFC 4180).
class CsvTable {
 public:
  explicit CsvTable(std::vector<CsvColumn> columns);
  /// Throws ContractError unless there is one cell per column.
  void add_row(std::vector<CsvCell> cells);
  /// A row of numbers only.
  void add_numbers(const std::vector<double>& values);
  /// Takes over rows that an earlier table of the same columns left in `text`, up to the first for which
  /// `wanted` is false; numbers stay the same to the last digit. For tables of numbers. Throws InputError
  /// naming `path` and the line when the header or the number of cells is another, or a cell is no number.
  void restore(const std::string& text, const std::string& path,
               const std::function<bool(const std::vector<double>&)>& wanted);
  size_t num_rows() const { return num_rows_; }
  const std::string& text() const { return text_; }  ///< header and rows, "\n" line ends
  /// Throws InputError naming the path.
  void write(const std::string& path) const;

 private:
  size_t num_columns_, num_rows_ = 0;
  std::string text_;
};

}  // namespace rhytid
