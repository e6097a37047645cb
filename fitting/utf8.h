// Names that the outside world chose, in files that must be UTF-8 (JSON, SVG). File names need not be.
// Tests: tests/fitting/calibration_test.cpp, landmarks_test.cpp
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace rhytid::fitting {

bool is_utf8(std::string_view text);

/// `text` with U+FFFD in place of what is not UTF-8.
std::string valid_utf8(std::string_view text);

/// The last `bytes` bytes of `text` (UTF-8) or up to three less, so that it begins with a whole character.
std::string utf8_tail(std::string_view text, std::size_t bytes);

}  // namespace rhytid::fitting
