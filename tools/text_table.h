// Tables for terminals.
// Tests: tests/tools/study_gradients_test.cpp (texts of a study), register_test.cpp
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace rhytid::tools {

/// A table of aligned columns for terminals: the first to the left, the others to the right.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string text() const;  ///< widths in characters of UTF-8

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace rhytid::tools
