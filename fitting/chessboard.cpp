#include "fitting/chessboard.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>

#include "sim/core/error.h"
#include "sim/core/parse_number.h"

namespace rhytid::fitting {
namespace {

constexpr int kSearchSide = 1200;  ///< px, longer side of the picture in which boards are looked for
constexpr int kLeast = 3, kMost = 100;

using Corners = std::vector<cv::Point2f>;

/// The board in a small picture. `size` is filled in when it was not given.
bool search(const cv::Mat& picture, const std::optional<BoardSize>& wanted, BoardSize* size,
            Corners* corners) {
  const int flags = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE;
  if (wanted) {
    *size = *wanted;
    const cv::Size pattern(wanted->columns, wanted->rows);
    if (cv::findChessboardCornersSB(picture, pattern, *corners, flags)) return true;
    return cv::findChessboardCorners(picture, pattern, *corners,
                                     cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE);
  }
  cv::Mat meta;  // one number per corner, in the shape of the board
  if (!cv::findChessboardCornersSB(picture, cv::Size(kLeast, kLeast), *corners, flags | cv::CALIB_CB_LARGER,
                                   meta))
    return false;
  *size = {meta.cols, meta.rows};
  return static_cast<std::size_t>(size->columns) * static_cast<std::size_t>(size->rows) == corners->size();
}

/// Least distance of neighbours in rows and columns, px.
double least_spacing(const BoardSize& size, const Corners& corners) {
  double least = 1e30;
  for (int row = 0; row < size.rows; ++row)
    for (int column = 0; column < size.columns; ++column) {
      const int i = row * size.columns + column;
      if (column > 0) least = std::min(least, cv::norm(corners[i] - corners[i - 1]));
      if (row > 0) least = std::min(least, cv::norm(corners[i] - corners[i - size.columns]));
    }
  return least;
}

/// Columns and rows clockwise in the picture (y down: x × y > 0), columns to the right, or down when they are
/// steep. Which corner is the first depends on nothing else.
void orient(const BoardSize& size, Corners* corners) {
  const cv::Point2f& origin = corners->front();
  const cv::Point2f along = (*corners)[static_cast<std::size_t>(size.columns) - 1] - origin;
  const cv::Point2f down = (*corners)[static_cast<std::size_t>(size.columns) * (size.rows - 1)] - origin;
  const bool is_forward = std::abs(along.x) >= std::abs(along.y) ? along.x > 0 : along.y > 0;
  if (along.x * down.y - along.y * down.x > 0) {
    if (!is_forward) std::reverse(corners->begin(), corners->end());
    return;
  }
  // Mirrored: either the order in the rows is turned around, or the order of the rows.
  if (!is_forward)
    for (int row = 0; row < size.rows; ++row) {
      const auto begin = corners->begin() + row * size.columns;
      std::reverse(begin, begin + size.columns);
    }
  else
    for (int row = 0; row < size.rows / 2; ++row)
      std::swap_ranges(corners->begin() + row * size.columns, corners->begin() + (row + 1) * size.columns,
                       corners->begin() + (size.rows - 1 - row) * size.columns);
}

}  // namespace

std::string to_string(const BoardSize& size) {
  return std::to_string(size.columns) + " x " + std::to_string(size.rows);
}

BoardSize parse_board_size(const std::string& text, const std::string& where) {
  const std::size_t cross = text.find('x');
  BoardSize size;
  const std::string_view view = text;
  if (cross == std::string::npos || !parse(view.substr(0, cross), size.columns) ||
      !parse(view.substr(cross + 1), size.rows) || std::min(size.columns, size.rows) < kLeast ||
      std::max(size.columns, size.rows) > kMost)
    throw InputError(where, "'" + text + "'",
                     "inner corners of the board as 9x6 (a board of 10 by 7 squares), each from 3 to 100");
  return size;
}

cv::Mat read_photograph(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw InputError(path, "no such file", "a photograph");
  if (std::filesystem::is_directory(path, ignored))
    throw InputError(path, "a folder", "photographs, as " + path + "/*.jpg");
  cv::Mat picture;
  try {
    picture = cv::imread(path, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
  }
  if (picture.empty()) throw InputError(path, "no picture", "a photograph (JPEG, PNG, TIFF, ...)");
  return picture;
}

std::optional<BoardView> find_board(const cv::Mat& grey, const std::optional<BoardSize>& wanted) {
  const double scale = std::min(1.0, static_cast<double>(kSearchSide) / std::max(grey.cols, grey.rows));
  cv::Mat small = grey;
  if (scale < 1) cv::resize(grey, small, cv::Size(), scale, scale, cv::INTER_AREA);
  BoardSize size;
  Corners corners;
  if (!search(small, wanted, &size, &corners)) return std::nullopt;
  for (cv::Point2f& p : corners) {
    p.x = static_cast<float>((p.x + 0.5) * grey.cols / small.cols - 0.5);
    p.y = static_cast<float>((p.y + 0.5) * grey.rows / small.rows - 0.5);
  }
  // The window must not reach the next corners; a larger one averages more noise, but sees more curvature.
  const int half = std::clamp(static_cast<int>(0.3 * least_spacing(size, corners)), 2, 15);
  cv::cornerSubPix(grey, corners, cv::Size(half, half), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3));
  orient(size, &corners);
  BoardView view;
  view.size = size;
  for (const cv::Point2f& p : corners) view.corners.emplace_back(p.x, p.y);
  return view;
}

}  // namespace rhytid::fitting
