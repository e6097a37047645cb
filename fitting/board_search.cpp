#include "fitting/board_search.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "sim/core/error.h"
#include "sim/output/text.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;

/// The same board seen upright or lying.
BoardSize lying(const BoardSize& size) {
  return {std::max(size.columns, size.rows), std::min(size.columns, size.rows)};
}

/// The size that most photographs show. Throws InputError when they do not agree.
BoardSize agreed_size(const std::vector<CalibrationPhotograph>& photographs) {
  std::map<std::pair<int, int>, int> counts;
  int found = 0;
  for (const CalibrationPhotograph& p : photographs) {
    if (p.board.corners.empty()) continue;
    const BoardSize size = lying(p.board.size);
    ++counts[{size.columns, size.rows}];
    ++found;
  }
  if (found == 0)
    throw InputError("calibrate",
                     "no checkerboard in " + counted(static_cast<long>(photographs.size()), "photograph"),
                     "boards that are seen whole, with a white rim");
  const auto most = std::max_element(counts.begin(), counts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most->second >= 2 && 2 * most->second >= found) return {most->first.first, most->first.second};
  std::string sizes;
  for (const auto& [size, count] : counts)
    if (sizes.size() < 100)
      sizes += (sizes.empty() ? "" : ", ") + to_string({size.first, size.second}) + " (" +
               std::to_string(count) + ")";
  throw InputError("--board", "nothing, and photographs of boards with " + sizes + " inner corners",
                   "the size of the board, as --board 9x6");
}

/// The size of most pictures with a board; the others lose their boards.
void agree_on_picture(const std::vector<cv::Size>& sizes, BoardSearch* search) {
  std::map<std::pair<int, int>, int> counts;
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (!search->photographs[i].board.corners.empty()) ++counts[{sizes[i].width, sizes[i].height}];
  const auto most = std::max_element(counts.begin(), counts.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  std::tie(search->width, search->height) = most->first;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (sizes[i] == cv::Size(search->width, search->height)) continue;
    CalibrationPhotograph& p = search->photographs[i];
    p.board.corners.clear();
    p.reason = std::to_string(sizes[i].width) + " x " + std::to_string(sizes[i].height) + " px, the others " +
               std::to_string(search->width) + " x " + std::to_string(search->height);
  }
}

}  // namespace

std::optional<BoardSearch> find_boards(const std::vector<std::string>& files,
                                       const std::optional<BoardSize>& wanted,
                                       const std::function<bool(int done)>& progress) {
  std::set<std::string> seen;
  for (const std::string& file : files) {
    std::error_code ignored;  // what is wrong with the file is said when it is read
    const fs::path path = fs::weakly_canonical(file, ignored);
    if (!seen.insert(ignored ? file : path.string()).second)
      throw InputError(file, "this photograph twice", "each once");
  }
  BoardSearch search;
  std::vector<cv::Size> sizes;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const cv::Mat grey = read_photograph(files[i]);
    sizes.push_back(grey.size());
    CalibrationPhotograph photograph;
    photograph.file = files[i];
    if (const auto board = find_board(grey, wanted)) photograph.board = *board;
    search.photographs.push_back(std::move(photograph));
    if (progress && !progress(static_cast<int>(i) + 1)) return std::nullopt;
  }
  search.board = wanted ? *wanted : agreed_size(search.photographs);
  bool is_any = false;
  for (CalibrationPhotograph& p : search.photographs) {
    // Where less of the board was seen at first, it is looked for as a whole.
    const bool is_whole = !p.board.corners.empty() && lying(p.board.size) == lying(search.board);
    if (!wanted && !is_whole) {
      const auto board = find_board(read_photograph(p.file), search.board);
      p.board = board ? *board : BoardView();
    }
    if (p.board.corners.empty()) p.reason = "no board of " + to_string(search.board) + " inner corners";
    is_any = is_any || !p.board.corners.empty();
  }
  if (!is_any) {
    // What they show instead is worth a line: squares counted instead of corners are the usual mistake.
    std::string instead;
    for (const CalibrationPhotograph& p : search.photographs) {
      const auto other = find_board(read_photograph(p.file), std::nullopt);
      if (other) instead = "; " + p.file + " shows one of " + to_string(lying(other->size));
      if (other) break;
    }
    throw InputError("--board",
                     "no board of " + to_string(search.board) + " inner corners in " +
                         counted(static_cast<long>(files.size()), "photograph") + instead,
                     "the corners where four squares meet: one less than squares, both ways");
  }
  agree_on_picture(sizes, &search);
  return search;
}

}  // namespace rhytid::fitting
