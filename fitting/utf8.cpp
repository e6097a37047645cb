#include "fitting/utf8.h"

#include <nlohmann/json.hpp>

namespace rhytid::fitting {

bool is_utf8(std::string_view text) {
  return valid_utf8(text) == text;
}

std::string valid_utf8(std::string_view text) {
  using nlohmann::json;
  const std::string quoted = json(text).dump(-1, ' ', false, json::error_handler_t::replace);
  return json::parse(quoted).get<std::string>();
}

std::string utf8_tail(std::string_view text, std::size_t bytes) {
  std::size_t begin = text.size() > bytes ? text.size() - bytes : 0;
  while (begin < text.size() && (static_cast<unsigned char>(text[begin]) & 0xC0) == 0x80) ++begin;
  return std::string(text.substr(begin));
}

}  // namespace rhytid::fitting
