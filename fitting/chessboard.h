// Inner corners of a checkerboard in a photograph, to a few hundredths of a pixel.
//
// The board is looked for in a smaller picture, which takes a second instead of a minute, and its corners are
// refined in the full one: each is the point q at which the grey gradients g_i of the pixels p_i around it all
// stand at right angles to p_i − q, since along an edge through the corner they do and on the plain squares
// there are none.
//
//   q = argmin Σ_i (g_iᵀ (p_i − q))²
//
// Source  OpenCV 4 calib3d, findChessboardCornersSB (A. Duda, U. Frese, "Accurate detection and localization
//         of checkerboard corners for calibration", BMVC 2018) and cornerSubPix.
// Tests   tests/fitting/calibration_test.cpp
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sim/core/types.h"

namespace rhytid::fitting {

/// Inner corners, where four squares meet: one less than squares in either direction.
struct BoardSize {
  int columns = 0, rows = 0;
  friend bool operator==(const BoardSize&, const BoardSize&) = default;
};

/// "9 x 6"
std::string to_string(const BoardSize& size);
/// Reads "9x6". Throws InputError that names `where` unless both are from 3 to 100.
BoardSize parse_board_size(const std::string& text, const std::string& where);

/// A board in a photograph. Rows go one after the other, columns to the right (down when they are steep), and
/// rows clockwise from the columns as seen, so that the board's third axis points away from the camera.
struct BoardView {
  BoardSize size;
  std::vector<Vec2> corners;  ///< [rows · columns], px
};

/// The photograph in grey as its camera made it, 8 bit: a note in the file to turn it is ignored, as with
/// footage. Throws InputError when the file is missing or no picture.
cv::Mat read_photograph(const std::string& path);

/// The board of this size in the picture; without a size whatever board is largest. None when there is none.
std::optional<BoardView> find_board(const cv::Mat& grey, const std::optional<BoardSize>& size);

}  // namespace rhytid::fitting
