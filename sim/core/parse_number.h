// Numbers in text files. Locale-free, unlike strtod and streams.
#pragma once

#include <charconv>
#include <string_view>

namespace rhytid {

/// Whether all of `word` is a number, a leading + allowed; `value` is then it.
template <typename Number>
bool parse(std::string_view word, Number& value) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

}  // namespace rhytid
