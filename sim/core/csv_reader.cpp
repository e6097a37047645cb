#include "sim/core/csv_reader.h"

#include <cmath>

#include "sim/core/error.h"
#include "sim/core/parse_number.h"

namespace rhytid {

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r"), last = text.find_last_not_of(" \t\r");
  return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

void for_csv_lines(std::istream& in, const std::string& name,
                   const std::function<void(const CsvLine&)>& use) {
  std::string line;
  for (long count = 1; std::getline(in, line); ++count) {
    CsvLine found;
    if (count == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // as spreadsheets begin UTF-8
    found.text = trimmed(line);
    if (found.text.empty() || found.text[0] == '#') continue;
    found.place = name + ":" + std::to_string(count);
    for (std::size_t begin = 0;;) {
      const std::size_t comma = found.text.find(',', begin);
      found.cells.push_back(trimmed(found.text.substr(begin, comma - begin)));
      if (comma == std::string::npos) break;
      begin = comma + 1;
    }
    use(found);
  }
}

void require_cells_as_in_header(const CsvLine& line, std::size_t count) {
  if (line.cells.size() != count)
    throw InputError(line.place, std::to_string(line.cells.size()) + " cells",
                     std::to_string(count) + " as in the header");
}

double csv_number(const std::string& cell, const std::string& place, const std::string& expected) {
  double value = 0;
  if (!parse(cell, value) || !std::isfinite(value))
    throw InputError(place, "'" + cell.substr(0, 40) + "'", expected);
  return value;
}

}  // namespace rhytid
