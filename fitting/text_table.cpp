#include "fitting/text_table.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/output/atomic_file.h"

namespace rhytid::fitting {
namespace {

constexpr std::string_view kBlanks = " \t\r";

std::string_view trimmed_view(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

bool equal_words(std::string_view a, std::string_view b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(),
                    [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

bool is_comment(std::string_view line) {
  return line.starts_with('#') || line.starts_with("***");
}

}  // namespace

TextTable::TextTable(const std::string& path) : path_(path), text_(read_file(path)) {
  if (text_.starts_with("\xef\xbb\xbf")) at_ = 3;  // the mark of UTF-8 that spreadsheets write
  std::string_view line;
  while (next_line(&line)) {
    if (is_comment(line)) {
      comments_.emplace_back(line);
      continue;
    }
    header_ = std::string(line.substr(0, 200));
    delimiter_ = ' ';
    for (const char c : {'\t', ';', ','})
      if (delimiter_ == ' ' && line.find(c) != std::string_view::npos) delimiter_ = c;
    std::vector<std::string_view> fields;
    split(line, &fields);
    for (const std::string_view field : fields) names_.emplace_back(field);
    return;
  }
  throw InputError(path_, "no line with names of columns", "a table with a header");
}

bool TextTable::next_line(std::string_view* line) {
  while (at_ < text_.size()) {
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    row_ = std::string_view(text_).substr(at_, end - at_);
    at_ = end + 1;
    ++line_;
    *line = trimmed_view(row_);
    if (!line->empty()) return true;
  }
  return false;
}

void TextTable::split(std::string_view line, std::vector<std::string_view>* fields) const {
  fields->clear();
  if (delimiter_ == ' ') {
    for (std::size_t at = line.find_first_not_of(kBlanks); at != std::string_view::npos;) {
      const std::size_t end = std::min(line.find_first_of(kBlanks, at), line.size());
      fields->push_back(line.substr(at, end - at));
      at = line.find_first_not_of(kBlanks, end);
    }
    return;
  }
  for (std::size_t at = 0; at <= line.size();) {
    const std::size_t end = std::min(line.find(delimiter_, at), line.size());
    fields->push_back(trimmed_view(line.substr(at, end - at)));
    at = end + 1;
  }
  // Some programs end every line, the header too, with a delimiter.
  if (fields->size() > 1 && fields->back().empty() && (names_.empty() || fields->size() == names_.size() + 1))
    fields->pop_back();
}

int TextTable::find(std::initializer_list<std::string_view> names) const {
  for (const std::string_view name : names)
    for (std::size_t i = 0; i < names_.size(); ++i)
      if (equal_words(names_[i], name)) return static_cast<int>(i);
  return -1;
}

int TextTable::column(std::initializer_list<std::string_view> names) const {
  const int found = find(names);
  if (found >= 0) return found;
  throw InputError(path_ + ":" + std::to_string(line_) + ":1", "columns '" + header_.substr(0, 100) + "'",
                   "a column " + std::string(*names.begin()));
}

bool TextTable::next() {
  std::string_view line;
  do
    if (!next_line(&line)) return false;
  while (is_comment(line));
  // Blanks at the ends belong to the line, unless they are delimiters.
  split(delimiter_ == '\t' ? row_ : line, &fields_);
  if (fields_.size() != names_.size())
    throw InputError(path_ + ":" + std::to_string(line_) + ":1", std::to_string(fields_.size()) + " fields",
                     std::to_string(names_.size()) + " as in the header");
  return true;
}

double TextTable::number(int column) const {
  const std::string_view field = text(column);
  double value = 0;
  if (parse(field, value)) return value;
  std::string_view word = field;
  if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.remove_prefix(1);
  if (word.starts_with("1.#") || (word.size() >= 3 && equal_words(word.substr(0, 3), "nan")))
    return std::numeric_limits<double>::quiet_NaN();
  refuse(column, "a number");
}

double TextTable::finite(int column) const {
  const double value = number(column);
  if (!std::isfinite(value)) refuse(column, "a finite number");
  return value;
}

int TextTable::index(int column) const {
  const double value = number(column);
  if (!(value >= 0 && value <= 2e9 && value == std::floor(value)))
    refuse(column, "a whole number, 0 or more");
  return static_cast<int>(value);
}

void TextTable::refuse(int column, const std::string& expected) const {
  const std::string_view field = text(column);
  const std::size_t place = field.empty() ? 0 : static_cast<std::size_t>(field.data() - row_.data());
  throw InputError(path_ + ":" + std::to_string(line_) + ":" + std::to_string(place + 1),
                   names_[static_cast<std::size_t>(column)] + " '" + std::string(field.substr(0, 60)) + "'",
                   expected);
}

}  // namespace rhytid::fitting
