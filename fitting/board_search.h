// The boards of a set of photographs: reads them one after the other, agrees on the size of the board.
// Tests: tests/fitting/calibration_test.cpp
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "fitting/calibration.h"

namespace rhytid::fitting {

struct BoardSearch {
  std::vector<CalibrationPhotograph> photographs;  ///< as given; those without a board say why
  BoardSize board;
  int width = 0, height = 0;  ///< px, of most photographs with a board
};

/// Looks for the board of size `wanted` in all files; without a size for that which most photographs show, at
/// least two and half of those with any. `progress(done)` is called after each; false stops, and nothing is
/// returned. Throws InputError for a file that is missing or no picture, for one given twice, when no board is
/// found anywhere, and when the photographs show boards of so different sizes that one must be given.
std::optional<BoardSearch> find_boards(const std::vector<std::string>& files,
                                       const std::optional<BoardSize>& wanted,
                                       const std::function<bool(int done)>& progress);

}  // namespace rhytid::fitting
