// Reading comma-separated files that people write: blanks around cells, comments and empty lines are welcome.
#pragma once

#include <functional>
#include <istream>
#include <string>
#include <vector>

namespace rhytid {

/// Without the blanks, tabs and carriage returns at both ends.
std::string trimmed(const std::string& text);

/// A line that says something.
struct CsvLine {
  std::string place;               ///< "file:line", for messages
  std::string text;                ///< trimmed
  std::vector<std::string> cells;  ///< between the commas, trimmed; at least one
};

/// Calls `use` with every line in order, but for empty ones and comments (#). `name` names the file in
/// places.
void for_csv_lines(std::istream& in, const std::string& name, const std::function<void(const CsvLine&)>& use);

/// Throws InputError unless `line` has as many cells as the header.
void require_cells_as_in_header(const CsvLine& line, std::size_t count);

/// The whole cell as a finite number; else InputError with `expected`.
double csv_number(const std::string& cell, const std::string& place,
                  const std::string& expected = "a finite number");

}  // namespace rhytid
