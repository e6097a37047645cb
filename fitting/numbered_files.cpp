#include "fitting/numbered_files.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string_view>

#include "sim/core/error.h"
#include "sim/core/parse_number.h"

namespace rhytid::fitting {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// `text` as a whole number; none when it is anything else.
std::optional<int> whole_number(std::string_view text) {
  int value = 0;
  const bool is_number =
      !text.empty() && std::all_of(text.begin(), text.end(), is_digit) && parse(text, value);
  return is_number ? std::optional<int>(value) : std::nullopt;
}

/// How many characters all names begin with, or end with, without the digits of a number that differs.
std::size_t common(const std::vector<std::string>& names, bool at_end) {
  const auto at = [at_end](const std::string& name, std::size_t i) {
    return at_end ? name[name.size() - 1 - i] : name[i];
  };
  std::size_t length = names.front().size();
  for (const std::string& name : names) {
    std::size_t same = 0;
    while (same < std::min(length, name.size()) && at(name, same) == at(names.front(), same)) ++same;
    length = same;
  }
  while (length > 0 && is_digit(at(names.front(), length - 1))) --length;
  return length;
}

int last_number(const std::string& name) {
  std::size_t end = name.size();
  while (end > 0 && !is_digit(name[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && is_digit(name[begin - 1])) --begin;
  return whole_number(std::string_view(name).substr(begin, end - begin)).value_or(1);
}

}  // namespace

std::vector<NumberedFile> number_files(const std::vector<std::string>& files,
                                       std::vector<std::string>& notes) {
  std::vector<std::string> names;
  for (const std::string& file : files) names.push_back(std::filesystem::path(file).stem().string());
  std::vector<NumberedFile> numbered;
  bool is_numbered = true;
  if (files.size() == 1) {
    numbered.push_back({files.front(), last_number(names.front())});
  } else {
    const std::size_t begin = common(names, false), end = common(names, true);
    for (std::size_t i = 0; i < files.size(); ++i) {
      const std::string& name = names[i];
      const auto number = name.size() > begin + end
                              ? whole_number(std::string_view(name).substr(begin, name.size() - begin - end))
                              : std::nullopt;
      is_numbered = is_numbered && number;
      numbered.push_back({files[i], number.value_or(0)});
    }
  }
  if (!is_numbered) {
    for (std::size_t i = 0; i < files.size(); ++i) numbered[i].number = static_cast<int>(i) + 1;
    notes.push_back("the names do not number the files: " + files.front() + " is taken as the first, " +
                    files.back() + " as number " + std::to_string(files.size()));
  }
  std::stable_sort(numbered.begin(), numbered.end(),
                   [](const NumberedFile& a, const NumberedFile& b) { return a.number < b.number; });
  for (std::size_t i = 1; i < numbered.size(); ++i)
    if (numbered[i].number == numbered[i - 1].number)
      throw InputError(numbered[i].path, "the number of " + numbered[i - 1].path, "a number for every file");
  return numbered;
}

}  // namespace rhytid::fitting
