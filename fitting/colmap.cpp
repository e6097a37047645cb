#include "fitting/colmap.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

#include "sim/core/error.h"
#include "sim/core/parse_number.h"
#include "sim/output/atomic_file.h"
#include "sim/output/text.h"
#include "sim/scene/located_json.h"
#include "sim/scene/nearest.h"

namespace rhytid::fitting {
namespace {

namespace fs = std::filesystem;

constexpr double kHalfPixel = 0.5;  ///< COLMAP's coordinates less ours, px

/// Which parameter is which, as indices into the line; −1: there is none.
struct Model {
  std::string_view name;
  int num_parameters;
  int fx, fy, cx, cy;
  std::array<int, 5> distortion;  ///< k1 k2 p1 p2 k3
};
constexpr std::array<Model, 6> kModels = {{
    {"SIMPLE_PINHOLE", 3, 0, 0, 1, 2, {-1, -1, -1, -1, -1}},
    {"PINHOLE", 4, 0, 1, 2, 3, {-1, -1, -1, -1, -1}},
    {"SIMPLE_RADIAL", 4, 0, 0, 1, 2, {3, -1, -1, -1, -1}},
    {"RADIAL", 5, 0, 0, 1, 2, {3, 4, -1, -1, -1}},
    {"OPENCV", 8, 0, 1, 2, 3, {4, 5, 6, 7, -1}},
    {"FULL_OPENCV", 12, 0, 1, 2, 3, {4, 5, 6, 7, 8}},
}};

std::string model_names() {
  std::string names;
  for (const Model& model : kModels) names += (names.empty() ? "" : ", ") + std::string(model.name);
  return names;
}

/// A text file line by line, with where it is.
class Lines {
 public:
  explicit Lines(const std::string& path) : path_(path), text_(read_file(path)) {}

  /// The next line, whatever is in it; false at the end.
  bool next() {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line_ = text_.substr(at_, end - at_);
    if (!line_.empty() && line_.back() == '\r') line_.pop_back();
    at_ = end + 1;
    ++number_;
    return true;
  }
  /// The next line that says something: not empty, no comment.
  bool next_entry() {
    while (next()) {
      const std::size_t begin = line_.find_first_not_of(" \t");
      if (begin == std::string::npos || line_[begin] == '#') continue;
      words_.clear();
      std::istringstream stream(line_);
      for (std::string word; stream >> word;) words_.push_back(word);
      return true;
    }
    return false;
  }
  /// Throws InputError unless the line has points, "X Y POINT3D_ID" each, or nothing.
  void check_points() const {
    std::size_t count = 0, at = line_.find_first_not_of(" \t");
    bool are_numbers = true;
    for (; at != std::string::npos && are_numbers; ++count) {
      const std::size_t end = std::min(line_.find_first_of(" \t", at), line_.size());
      double value = 0;
      are_numbers = parse(std::string_view(line_).substr(at, end - at), value);
      at = line_.find_first_not_of(" \t", end);
    }
    if (!are_numbers || count % 3 != 0)
      refuse("'" + shown_text(line_.substr(0, 40)) + "'",
             "the points of the image above, X Y POINT3D_ID each, or an empty line");
  }
  const std::vector<std::string>& words() const { return words_; }
  /// Everything from the word `index` on.
  std::string rest(std::size_t index) const {
    std::size_t at = 0;
    for (std::size_t i = 0; i <= index; ++i) {
      at = line_.find_first_not_of(" \t", at);
      if (i < index) at = line_.find_first_of(" \t", at);
    }
    std::string text = line_.substr(at);
    text.erase(text.find_last_not_of(" \t") + 1);
    return text;
  }
  double number(std::size_t word, const char* what) const {
    double value = 0;
    if (!parse(std::string_view(words_[word]), value) || !std::isfinite(value))
      refuse(std::string(what) + " '" + words_[word] + "'", "a finite number");
    return value;
  }
  int whole(std::size_t word, const char* what) const {
    const double value = number(word, what);
    if (value != std::floor(value) || !(std::abs(value) < 2e9))
      refuse(std::string(what) + " '" + words_[word] + "'", "a whole number");
    return static_cast<int>(value);
  }
  [[noreturn]] void refuse(const std::string& found, const std::string& expected) const {
    throw InputError(path_ + ":" + std::to_string(number_), found, expected);
  }

 private:
  std::string path_, text_, line_;
  std::vector<std::string> words_;
  std::size_t at_ = 0;
  int number_ = 0;
};

fs::path folder_of(const std::string& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored) ? fs::path(path) : fs::path(path).parent_path();
}

struct Image {
  Eigen::Quaterniond rotation;
  Vec3 translation;  ///< COLMAP's units
  int camera = 0;
  std::string name;
};

std::vector<Image> read_images(const std::string& file) {
  Lines lines(file);
  std::vector<Image> images;
  while (lines.next_entry()) {
    if (lines.words().size() < 10)
      lines.refuse(counted(static_cast<long>(lines.words().size()), "word"),
                   "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME (and a line of points, perhaps empty, after "
                   "each image)");
    lines.whole(0, "IMAGE_ID");
    Image image;
    const double qw = lines.number(1, "QW"), qx = lines.number(2, "QX"), qy = lines.number(3, "QY"),
                 qz = lines.number(4, "QZ");
    image.rotation = Eigen::Quaterniond(qw, qx, qy, qz);
    // Far from unit length it is something else than a rotation; rounding of few digits stays below 1e-3.
    if (std::abs(image.rotation.norm() - 1) > 1e-3)
      lines.refuse("a quaternion of length " + short_text(image.rotation.norm()), "a rotation of length 1");
    image.rotation.normalize();
    image.translation = {lines.number(5, "TX"), lines.number(6, "TY"), lines.number(7, "TZ")};
    image.camera = lines.whole(8, "CAMERA_ID");
    image.name = lines.rest(9);
    images.push_back(image);
    if (lines.next()) lines.check_points();
  }
  return images;
}

/// The image that `name` asks for.
const Image& chosen(const std::vector<Image>& images, const std::string& file, const std::string& name) {
  if (images.empty()) throw InputError(file, "no images", "at least one");
  std::vector<std::string> names;
  for (const Image& image : images) names.push_back(image.name);
  if (name.empty()) {
    if (images.size() == 1) return images.front();
    throw InputError(file, std::to_string(images.size()) + " images",
                     "the name of one of them, as " + names.front());
  }
  const Image* found = nullptr;
  for (const Image& image : images) {
    if (image.name == name) return image;
    if (!image.name.ends_with("/" + name)) continue;
    if (found != nullptr)
      throw InputError(file, "'" + name + "' of two images",
                       "a whole name: " + found->name + " or " + image.name);
    found = &image;
  }
  if (found != nullptr) return *found;
  throw InputError(file, "no image '" + name + "'",
                   "one of its names, nearest is '" + nearest_word(name, names) + "'");
}

/// Intrinsics of a line of cameras.txt.
Camera read_intrinsics(const Lines& lines) {
  const std::vector<std::string>& words = lines.words();
  const auto model =
      std::find_if(kModels.begin(), kModels.end(), [&](const Model& m) { return m.name == words[1]; });
  if (model == kModels.end()) lines.refuse("model " + words[1], model_names());
  const int given = static_cast<int>(words.size()) - 4;
  if (given != model->num_parameters)
    lines.refuse(counted(given, "parameter"),
                 std::to_string(model->num_parameters) + " of " + std::string(model->name));
  Camera camera;
  camera.width = lines.whole(2, "WIDTH"), camera.height = lines.whole(3, "HEIGHT");
  if (!(camera.width >= 1 && camera.width <= 100000 && camera.height >= 1 && camera.height <= 100000))
    lines.refuse(words[2] + " x " + words[3] + " px", "whole numbers of px from 1 to 100000");
  const auto parameter = [&](int index) {
    return index < 0 ? 0 : lines.number(static_cast<std::size_t>(index) + 4, "parameter");
  };
  Mat3& K = camera.intrinsics;
  K(0, 0) = parameter(model->fx), K(1, 1) = parameter(model->fy);
  K(0, 2) = parameter(model->cx) - kHalfPixel, K(1, 2) = parameter(model->cy) - kHalfPixel;
  if (!(K(0, 0) > 0 && K(1, 1) > 0))
    lines.refuse("focal lengths " + short_text(K(0, 0)) + ", " + short_text(K(1, 1)), "positive ones");
  for (std::size_t i = 0; i < 5; ++i) camera.distortion[i] = parameter(model->distortion[i]);
  for (int i = 9; i < model->num_parameters; ++i)
    if (parameter(i) != 0)
      lines.refuse("k4, k5 or k6 of FULL_OPENCV", "zeros (rational models are not supported)");
  return camera;
}

Camera intrinsics_of(const std::string& file, int id) {
  Lines lines(file);
  while (lines.next_entry()) {
    if (lines.words().size() < 5) lines.refuse("too few words", "CAMERA_ID MODEL WIDTH HEIGHT PARAMS...");
    if (lines.whole(0, "CAMERA_ID") == id) return read_intrinsics(lines);
  }
  throw InputError(file, "no camera " + std::to_string(id), "the camera that images.txt names");
}

void check_scale(double mm_per_unit) {
  if (!(mm_per_unit > 0) || !std::isfinite(mm_per_unit))
    throw InputError("mm per unit of COLMAP", short_text(mm_per_unit), "a length above 0");
}

}  // namespace

bool is_colmap(const std::string& path) {
  std::error_code ignored;
  const fs::path name = fs::path(path).filename();
  if (!fs::is_directory(path, ignored) && name != "cameras.txt" && name != "images.txt") return false;
  return fs::exists(folder_of(path) / "cameras.txt", ignored) &&
         fs::exists(folder_of(path) / "images.txt", ignored);
}

std::vector<std::string> colmap_images(const std::string& path) {
  std::vector<std::string> names;
  for (const Image& image : read_images((folder_of(path) / "images.txt").string()))
    names.push_back(image.name);
  return names;
}

Camera read_colmap_camera(const std::string& path, const std::string& image_name, double mm_per_unit) {
  check_scale(mm_per_unit);
  const std::string images_file = (folder_of(path) / "images.txt").string();
  const std::vector<Image> images = read_images(images_file);
  const Image& image = chosen(images, images_file, image_name);
  Camera camera = intrinsics_of((folder_of(path) / "cameras.txt").string(), image.camera);
  camera.name = fs::path(image.name).stem().string();
  camera.rotation = image.rotation.toRotationMatrix();
  camera.translation = mm_per_unit * image.translation;
  return camera;
}

void write_colmap_cameras(const std::vector<Camera>& cameras, const std::string& folder, double mm_per_unit) {
  check_scale(mm_per_unit);
  std::string intrinsics = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS...\n";
  std::string images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points\n";
  std::set<std::string> names;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    if (c.name.empty() || c.name.find_first_of(" \t\r\n") != std::string::npos ||
        !names.insert(c.name).second)
      throw InputError("camera '" + c.name + "'", "this name", "one without blanks, once, for images.txt");
    const auto& d = c.distortion;
    const bool is_full = d[4] != 0;
    const bool is_distorted = is_full || std::any_of(d.begin(), d.end(), [](double k) { return k != 0; });
    const std::string id = std::to_string(i + 1);
    intrinsics += id +
                  (is_full        ? " FULL_OPENCV "
                   : is_distorted ? " OPENCV "
                                  : " PINHOLE ") +
                  std::to_string(c.width) + " " + std::to_string(c.height);
    for (const double value : {c.intrinsics(0, 0), c.intrinsics(1, 1), c.intrinsics(0, 2) + kHalfPixel,
                               c.intrinsics(1, 2) + kHalfPixel})
      intrinsics += " " + exact_text(value);
    if (is_distorted)
      for (std::size_t k = 0; k < (is_full ? 5u : 4u); ++k) intrinsics += " " + exact_text(d[k]);
    intrinsics += is_full ? " 0 0 0\n" : "\n";
    const Eigen::Quaterniond q(c.rotation);
    images += id;
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) images += " " + exact_text(value);
    for (const double value : c.translation) images += " " + exact_text(value / mm_per_unit);
    images += " " + id + " " + c.name + "\n\n";
  }
  write_file((fs::path(folder) / "cameras.txt").string(), intrinsics);
  write_file((fs::path(folder) / "images.txt").string(), images);
}

}  // namespace rhytid::fitting
