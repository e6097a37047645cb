#include "fitting/tracking/frame_source.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "sim/core/error.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;

/// "f9" before "f10": runs of digits compare as numbers.
bool natural_less(const std::string& a, const std::string& b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      std::size_t end_a = i, end_b = j;
      while (end_a < a.size() && is_digit(a[end_a])) ++end_a;
      while (end_b < b.size() && is_digit(b[end_b])) ++end_b;
      while (i < end_a && a[i] == '0') ++i;
      while (j < end_b && b[j] == '0') ++j;
      if (end_a - i != end_b - j) return end_a - i < end_b - j;
      const int order = a.compare(i, end_a - i, b, j, end_b - j);
      if (order != 0) return order < 0;
      i = end_a;
      j = end_b;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  return a.size() - i < b.size() - j;
}

/// Does `name` match a pattern of literals, `*` and `?`?
bool glob_match(const char* pattern, const char* name) {
  if (*pattern == '\0') return *name == '\0';
  if (*pattern == '*')
    return glob_match(pattern + 1, name) || (*name != '\0' && glob_match(pattern, name + 1));
  return *name != '\0' && (*pattern == '?' || *pattern == *name) && glob_match(pattern + 1, name + 1);
}

std::vector<std::string> expand_glob(const std::string& path) {
  const fs::path full(path);
  const fs::path folder = full.has_parent_path() ? full.parent_path() : fs::path(".");
  if (!fs::is_directory(folder)) throw InputError(path, "no such folder", "a folder with images");
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file() && glob_match(full.filename().c_str(), name.c_str())) names.push_back(name);
  }
  std::sort(names.begin(), names.end(), natural_less);
  for (std::string& name : names) name = (folder / name).string();
  if (names.empty()) throw InputError(path, "no matching file", "at least one image");
  return names;
}

/// The smallest number above `number` of which `name` is a file's; nothing when there is none. Looks at the files that are
/// there, since numbers may be far apart.
template <class Name>
std::optional<int> next_number(const std::string& path, int number, const Name& name) {
  const fs::path folder = fs::path(path).parent_path();
  const std::string begin = fs::path(path.substr(0, path.find('%'))).filename().string();
  std::optional<int> next;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, ignored)) {
    const std::string file = entry.path().filename().string();
    if (!file.starts_with(begin)) continue;
    std::size_t at = file.find_first_not_of(' ', begin.size()), end = at;
    while (end < file.size() && file[end] >= '0' && file[end] <= '9') ++end;
    if (at == std::string::npos || end == at || end - at > 9) continue;
    const int found = std::stoi(file.substr(at, end - at));
    if (found > number && (!next || found < *next) && fs::path(name(found)).filename() == file) next = found;
  }
  return next;
}

/// A pattern with exactly one %d or %0Nd: expands the numbers from 0 (or 1) until a file is missing. Throws InputError
/// when others come after that one, but for frames after `last` (−1: none).
std::vector<std::string> expand_printf(const std::string& path, int last) {
  const std::size_t percent = path.find('%');
  std::size_t end = percent + 1;
  while (end < path.size() && path[end] >= '0' && path[end] <= '9') ++end;
  if (end >= path.size() || path[end] != 'd' || path.find('%', end) != std::string::npos || end - percent > 4)
    throw InputError(path, "an unusable number pattern", "one %d, such as frame_%04d.png");
  const std::string digits = path.substr(percent + 1, end - percent - 1);
  const std::size_t width = digits.empty() ? 0 : static_cast<std::size_t>(std::stoi(digits));
  const char fill = !digits.empty() && digits[0] == '0' ? '0' : ' ';
  const auto name = [&](int number) {
    std::string text = std::to_string(number);
    if (text.size() < width) text.insert(0, width - text.size(), fill);
    return path.substr(0, percent) + text + path.substr(end + 1);
  };
  std::vector<std::string> names;
  for (int number = fs::exists(name(0)) ? 0 : 1; fs::exists(name(number)); ++number)
    names.push_back(name(number));
  if (names.empty())
    throw InputError(path, "no file " + name(0) + " or " + name(1), "a sequence numbered from 0 or 1");
  const bool is_enough = last >= 0 && static_cast<std::size_t>(last) < names.size();
  const int missing = static_cast<int>(names.size()) + (names.front() == name(0) ? 0 : 1);
  if (const auto later = next_number(path, missing, name); later && !is_enough)
    throw InputError(path, "no file " + name(missing) + " before " + name(*later), "a sequence without gaps");
  return names;
}

bool is_image(const std::string& path) {
  std::string ext = fs::path(path).extension().string();
  std::transform(ext.begin(), ext.end(), ext.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const char* known : {".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".webp"})
    if (ext == known) return true;
  return false;
}

/// Luma in floating point: rounding to 8 bits here would add noise to every colour frame.
cv::Mat to_grey(const cv::Mat& image, double to_255) {
  cv::Mat real, grey;
  image.convertTo(real, CV_32F, to_255);
  if (real.channels() == 1)
    grey = real;
  else
    cv::cvtColor(real, grey, real.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  return grey;
}

cv::Mat to_colour(const cv::Mat& image, double to_255) {
  cv::Mat bytes, colour;
  image.convertTo(bytes, CV_8U, to_255);
  if (bytes.channels() == 3) return bytes;
  cv::cvtColor(bytes, colour, bytes.channels() == 4 ? cv::COLOR_BGRA2BGR : cv::COLOR_GRAY2BGR);
  return colour;
}

}  // namespace

struct FrameSource::Reader {
  std::string origin;
  std::vector<std::string> images;  // empty for video
  cv::VideoCapture video;
  int cursor = 0;  // index of the frame that the next read delivers
  int total = 0;   // frames in the footage as far as known, 0 = unknown
  double rate = 1;
  cv::Size size;
  double quantum = 1;
  // Backwards: frames that wait to be delivered, the next one last, and how many come before them.
  std::vector<Frame> block;
  int before_block = 0;

  cv::Mat load(int index) const {
    const cv::Mat image = cv::imread(images[index], cv::IMREAD_UNCHANGED);
    if (image.empty()) throw InputError(images[index], "an unreadable image", "an 8 or 16 bit image file");
    if (image.depth() != CV_8U && image.depth() != CV_16U)
      throw InputError(images[index], "an image of depth code " + std::to_string(image.depth()),
                       "8 or 16 bit values");
    return image;
  }
};

FrameSource::FrameSource(FrameSourceOptions options)
    : options_(std::move(options)), reader_(std::make_unique<Reader>()) {
  Reader& r = *reader_;
  const FrameSourceOptions& o = options_;
  r.origin = o.images.empty() ? o.path : "image list";
  if (o.first < 0 || o.step < 1 || (o.last >= 0 && o.last < o.first))
    throw InputError(r.origin + ": frame range",
                     "first " + std::to_string(o.first) + ", last " + std::to_string(o.last) + ", step " +
                         std::to_string(o.step),
                     "0 <= first <= last, step >= 1");
  if (!(o.frames_per_second >= 0) || !std::isfinite(o.frames_per_second) || !std::isfinite(o.start_time_s))
    throw InputError(r.origin + ": frames_per_second or start_time_s", "a negative or non-finite value",
                     "frames per second >= 0 and a finite start");
  if (!o.images.empty()) {
    r.images = o.images;
  } else if (fs::is_regular_file(o.path)) {
    if (is_image(o.path)) r.images = {o.path};
  } else if (o.path.find('%') != std::string::npos) {
    r.images = expand_printf(o.path, o.last);
  } else if (o.path.find_first_of("*?") != std::string::npos) {
    r.images = expand_glob(o.path);
  } else {
    throw InputError(o.path, "no such file",
                     "a video, an image, a pattern like f_%04d.png, or a glob like *.png");
  }

  if (!r.images.empty()) {
    const cv::Mat first = r.load(0);
    r.total = static_cast<int>(r.images.size());
    r.size = first.size();
    r.quantum = first.depth() == CV_16U ? 255.0 / 65535.0 : 1.0;
    r.rate = o.frames_per_second > 0 ? o.frames_per_second : 1;
  } else {
    // Named back ends: trying all of them fills the terminal with the complaints of those that do not fit.
    if (!r.video.open(o.path, cv::CAP_FFMPEG) && !r.video.open(o.path, cv::CAP_OPENCV_MJPEG))
      throw InputError(o.path, "a file that no decoder opens", "a readable video");
    r.total = std::max(0, static_cast<int>(r.video.get(cv::CAP_PROP_FRAME_COUNT)));
    r.size = {static_cast<int>(r.video.get(cv::CAP_PROP_FRAME_WIDTH)),
              static_cast<int>(r.video.get(cv::CAP_PROP_FRAME_HEIGHT))};
    const double own = r.video.get(cv::CAP_PROP_FPS);
    r.rate = o.frames_per_second > 0 ? o.frames_per_second : own;
    if (!(r.rate > 0) || !std::isfinite(r.rate))
      throw InputError(o.path, "a video without a frame rate", "frames_per_second in the options");
  }
  if (r.total > 0 && o.first >= r.total)
    throw InputError(r.origin + ": first", std::to_string(o.first),
                     "less than the " + std::to_string(r.total) + " frames there are");
  if (o.backwards) {
    if (o.last < 0 && r.total == 0)
      throw InputError(o.path, "a video that does not say how long it is",
                       "a last frame, to read backwards from");
    const int end =
        r.total > 0 && o.last >= 0 ? std::min(o.last + 1, r.total) : std::max(o.last + 1, r.total);
    r.before_block = (end - o.first + o.step - 1) / o.step;
  }
}

FrameSource::~FrameSource() = default;
std::vector<std::string> FrameSource::files() const {
  return reader_->images.empty() ? std::vector<std::string>{options_.path} : reader_->images;
}

FrameSource::FrameSource(FrameSource&&) noexcept = default;
FrameSource& FrameSource::operator=(FrameSource&&) noexcept = default;

std::optional<Frame> FrameSource::next() {
  return options_.backwards ? next_backwards() : next_forwards();
}

std::optional<Frame> FrameSource::next_backwards() {
  constexpr double kBlock = 256e6;  // bytes
  Reader& r = *reader_;
  const double frame_bytes = 7.0 * r.size.area();  // grey in floating point and colour
  const int longest = std::max(8, static_cast<int>(kBlock / std::max(1.0, frame_bytes)));
  // A file that is shorter than it says has nothing in its last blocks.
  while (r.block.empty()) {
    if (r.before_block == 0) return std::nullopt;
    const int count = std::min(r.before_block, longest);
    r.before_block -= count;
    FrameSourceOptions part = options_;
    part.backwards = false;
    part.first = options_.first + r.before_block * options_.step;
    part.last = part.first + (count - 1) * options_.step;
    FrameSource forwards(part);
    while (std::optional<Frame> frame = forwards.next()) r.block.push_back(std::move(*frame));
  }
  Frame frame = std::move(r.block.back());
  r.block.pop_back();
  return frame;
}

std::optional<Frame> FrameSource::next_forwards() {
  Reader& r = *reader_;
  // Seeking by index is inexact in many containers, so skipped frames are decoded and dropped.
  const auto wanted = [&](int index) {
    return index >= options_.first && (index - options_.first) % options_.step == 0;
  };
  for (;; ++r.cursor) {
    if (options_.last >= 0 && r.cursor > options_.last) return std::nullopt;
    cv::Mat image;
    if (!r.images.empty()) {
      if (r.cursor >= r.total) return std::nullopt;
      if (!wanted(r.cursor)) continue;
      image = r.load(r.cursor);
      if (image.size() != r.size)
        throw InputError(
            r.images[r.cursor], std::to_string(image.cols) + " x " + std::to_string(image.rows) + " px",
            std::to_string(r.size.width) + " x " + std::to_string(r.size.height) + " like the first image");
    } else {
      if (!r.video.grab()) return std::nullopt;
      if (!wanted(r.cursor)) continue;
      if (!r.video.retrieve(image) || image.empty()) return std::nullopt;
    }
    const double to_255 = image.depth() == CV_16U ? 255.0 / 65535.0 : 1.0;
    Frame frame;
    frame.index = r.cursor++;
    frame.time_s = options_.start_time_s + frame.index / r.rate;
    frame.grey = to_grey(image, to_255);
    frame.colour = to_colour(image, to_255);
    if (frame.colour.data == image.data)
      frame.colour = frame.colour.clone();  // the decoder reuses its buffer
    return frame;
  }
}

int FrameSource::frames_asked() const {
  const int end = options_.last >= 0 ? options_.last + 1 : reader_->total;
  return end <= options_.first ? 0 : (end - options_.first + options_.step - 1) / options_.step;
}

double FrameSource::frames_per_second() const {
  return reader_->rate;
}
cv::Size FrameSource::size() const {
  return reader_->size;
}
double FrameSource::quantum() const {
  return reader_->quantum;
}

}  // namespace rhytid::fitting
