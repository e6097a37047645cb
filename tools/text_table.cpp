#include "tools/text_table.h"

#include <algorithm>
#include <cstddef>

namespace rhytid::tools {
namespace {

/// Of UTF-8: all bytes but those that continue one.
std::size_t characters(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

}  // namespace

std::string TextTable::text() const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_)
    for (std::size_t k = 0; k < row.size(); ++k) widths[k] = std::max(widths[k], characters(row[k]));
  std::string all;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) {
      const std::string blanks(widths[k] - characters(row[k]), ' ');
      line += (k == 0 ? "" : "  ") + (k == 0 ? row[k] + blanks : blanks + row[k]);
    }
    while (!line.empty() && line.back() == ' ') line.pop_back();
    all += line + "\n";
  }
  return all;
}

}  // namespace rhytid::tools
