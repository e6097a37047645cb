// A check of options that are a share: 0 to 1.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace rhytid::tools {

/// Accepts numbers from 0 to 1; unlike CLI::Range it refuses NaN.
inline CLI::Validator share_check() {
  return CLI::Validator(
      [](std::string& text) {
        double value = -1;
        const bool is_share = CLI::detail::lexical_cast(text, value) && value >= 0 && value <= 1;
        return is_share ? std::string() : "got " + text + ", expected a number from 0 to 1";
      },
      "");
}

}  // namespace rhytid::tools
