// Words and numbers of text mesh files. Internal to sim/mesh.
#pragma once

#include <algorithm>
#include <charconv>
#include <string_view>

namespace rhytid {

/// Cuts the next word (up to white space) off `rest`; empty at the end.
inline std::string_view next_word(std::string_view& rest) {
  const std::size_t begin = rest.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) {
    rest = {};
    return {};
  }
  const std::size_t end = std::min(rest.find_first_of(" \t\r", begin), rest.size());
  const std::string_view word = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return word;
}

/// Whether all of `word` is a number. Locale-free, unlike strtod and streams.
template <typename Number>
bool parse(std::string_view word, Number& value) {
  if (word.size() > 1 && word[0] == '+') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

}  // namespace rhytid
