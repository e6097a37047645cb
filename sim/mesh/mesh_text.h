// Words of text mesh files. Internal to sim/mesh.
#pragma once

#include <algorithm>
#include <string_view>

#include "sim/core/parse_number.h"

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

}  // namespace rhytid
