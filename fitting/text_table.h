// Tables of numbers that other programs write: a header with names, one row a line, any usual delimiter. Made
// for files of millions of rows; every message says file:line:column.
// Tests: tests/fitting/track_import_test.cpp
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace rhytid::fitting {

/// One table in memory, read row by row. Lines that begin with # or *** are comments.
class TextTable {
 public:
  /// Reads the file up to its header. The delimiter is the first of tab, semicolon and comma that the header
  /// has, else blanks. Throws InputError when the file cannot be read or has no header.
  explicit TextTable(const std::string& path);
  TextTable(const TextTable&) = delete;
  TextTable& operator=(const TextTable&) = delete;

  const std::string& path() const { return path_; }
  /// The header as it is in the file.
  const std::string& header() const { return header_; }
  /// Comment lines before the header, without line ends.
  const std::vector<std::string>& comments() const { return comments_; }

  /// Index of the column with one of these names (capital letters or not), the first name first; −1: none.
  int find(std::initializer_list<std::string_view> names) const;
  /// The same; throws InputError that says the first name when there is none.
  int column(std::initializer_list<std::string_view> names) const;

  /// Goes to the next row; false at the end. Throws InputError when it has not as many fields as the header.
  bool next();
  /// The field of the current row, without blanks around it.
  std::string_view text(int column) const { return fields_[static_cast<std::size_t>(column)]; }
  /// The field as a number; NaN and infinities are numbers here, also as Windows writes them. Throws
  /// InputError.
  double number(int column) const;
  /// The field as a finite number. Throws InputError.
  double finite(int column) const;
  /// The field as a whole number ≥ 0, also when written like 3.0. Throws InputError.
  int index(int column) const;
  int line() const { return line_; }
  /// Throws InputError "file:line:column: got NAME 'text', expected ...".
  [[noreturn]] void refuse(int column, const std::string& expected) const;

 private:
  bool next_line(std::string_view* line);
  void split(std::string_view line, std::vector<std::string_view>* fields) const;

  std::string path_, text_, header_;
  std::vector<std::string> comments_, names_;
  std::vector<std::string_view> fields_;
  std::string_view row_;
  std::size_t at_ = 0;
  int line_ = 0;
  char delimiter_ = ',';
};

}  // namespace rhytid::fitting
