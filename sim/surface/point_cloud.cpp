#include "sim/surface/point_cloud.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>
#include <vector>

#include "sim/core/error.h"
#include "sim/core/parse_number.h"

namespace rhytid {
namespace {

constexpr std::string_view kBlank = " \t\r,";

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  line = line.substr(0, line.find('#'));
  for (std::size_t at = line.find_first_not_of(kBlank); at != std::string_view::npos;
       at = line.find_first_not_of(kBlank, at)) {
    const std::size_t end = std::min(line.find_first_of(kBlank, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

std::string shown(std::string_view text) {
  return "'" + std::string(text.substr(0, 60)) + "'";
}

/// Collects what a file says and refuses what is no cloud.
class CloudReader {
 public:
  CloudReader(const std::string& path, double mm_per_unit)
      : path_(path), mm_per_unit_(mm_per_unit), file_(path, std::ios::binary) {
    if (!file_)
      throw InputError(path_, "a file that cannot be opened", "a cloud of points: .ply, .obj, .xyz or .txt");
  }

  PointCloud read() {
    std::string ending = path_.substr(std::min(path_.rfind('.'), path_.size()));
    for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (ending == ".ply") {
      read_ply();
    } else if (ending == ".obj") {
      read_obj();
    } else if (ending == ".xyz" || ending == ".txt") {
      read_xyz();
    } else {
      throw InputError(path_, "the ending " + shown(ending), "a cloud of points: .ply, .obj, .xyz or .txt");
    }
    return finish();
  }

 private:
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw InputError(path_ + ":" + std::to_string(line_number_), found, expected);
  }

  bool next_line() {
    if (!std::getline(file_, line_)) return false;
    ++line_number_;
    return true;
  }

  Vec3 vector(const std::vector<std::string_view>& words, std::size_t first) const {
    if (words.size() < first + 3) fail(std::to_string(words.size() - first) + " numbers", "three");
    Vec3 v;
    for (std::size_t k = 0; k < 3; ++k)
      if (!parse(words[first + k], v[static_cast<Eigen::Index>(k)]))
        fail(shown(words[first + k]), "a number");
    return v;
  }

  void read_xyz() {
    while (next_line()) {
      const auto words = words_of(line_);
      if (words.empty()) continue;
      if (words.size() < 6)
        fail(std::to_string(words.size()) + " numbers", "six: x y z and the normal nx ny nz");
      points_.push_back(vector(words, 0));
      normals_.push_back(vector(words, 3));
    }
  }

  void read_obj() {
    std::vector<Vec3> directions;
    std::vector<std::pair<int, int>> corners;  // point, normal
    while (next_line()) {
      const auto words = words_of(line_);
      if (words.empty()) continue;
      if (words[0] == "v") points_.push_back(vector(words, 1));
      if (words[0] == "vn") directions.push_back(vector(words, 1));
      if (words[0] == "f")
        for (std::size_t k = 1; k < words.size(); ++k)
          if (const auto corner = obj_corner(words[k], directions.size())) corners.push_back(*corner);
    }
    if (corners.empty() && directions.size() != points_.size())
      throw InputError(
          path_,
          std::to_string(points_.size()) + " points and " + std::to_string(directions.size()) + " normals",
          "a normal per point: as many vn as v, or faces that name them");
    if (corners.empty()) {
      normals_ = std::move(directions);
      return;
    }
    normals_.assign(points_.size(), Vec3::Zero());
    for (const auto& [point, normal] : corners) normals_[point] += directions[normal].stableNormalized();
  }

  /// v//vn or v/vt/vn; nothing when the corner names no normal.
  std::optional<std::pair<int, int>> obj_corner(std::string_view word, std::size_t num_normals) const {
    const std::size_t last = word.rfind('/');
    if (last == std::string_view::npos || word.find('/') == last) return {};
    const auto index = [&](std::string_view text, std::size_t count) {
      long i = 0;
      if (!parse(text, i)) fail("face corner " + shown(word), "v//vn or v/vt/vn");
      if (i < 0) i += static_cast<long>(count) + 1;
      if (i < 1 || i > static_cast<long>(count))
        fail("face corner " + shown(word), "indices from 1 to the number of lines above");
      return static_cast<int>(i - 1);
    };
    return std::pair(index(word.substr(0, word.find('/')), points_.size()),
                     index(word.substr(last + 1), num_normals));
  }

  struct PlyProperty {
    std::string name;
    char kind = 'f';  // i, u, f
    std::size_t size = 4;
    bool is_list = false;
  };
  struct PlyElement {
    std::string name;
    long count = 0;
    std::vector<PlyProperty> properties;
  };

  PlyProperty ply_property(const std::vector<std::string_view>& words) const {
    if (words.size() < 3) fail(shown(line_), "property TYPE NAME");
    if (words[1] == "list") return {std::string(words.back()), 'f', 0, true};
    static constexpr std::array<std::string_view, 16> names{
        "char", "uchar", "short", "ushort", "int",   "uint",   "float",   "double",
        "int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};
    static constexpr std::array<char, 8> kinds{'i', 'u', 'i', 'u', 'i', 'u', 'f', 'f'};
    static constexpr std::array<std::size_t, 8> sizes{1, 1, 2, 2, 4, 4, 4, 8};
    const auto found = std::find(names.begin(), names.end(), words[1]);
    if (found == names.end()) fail("the type " + shown(words[1]), "a scalar type of PLY");
    const auto type = static_cast<std::size_t>(found - names.begin()) % 8;
    return {std::string(words[2]), kinds[type], sizes[type], false};
  }

  void read_ply() {
    if (!next_line() || words_of(line_) != std::vector<std::string_view>{"ply"}) fail(shown(line_), "ply");
    std::string format;
    std::vector<PlyElement> elements;
    while (true) {
      if (!next_line()) fail("the end of the file", "end_header");
      const auto words = words_of(line_);
      if (words.empty()) continue;
      if (words[0] == "end_header") break;
      if (words[0] == "format" && words.size() > 1) format = words[1];
      if (words[0] == "element") {
        long count = 0;
        if (words.size() < 3 || !parse(words[2], count) || count < 0)
          fail(shown(line_), "element NAME COUNT");
        elements.push_back({std::string(words[1]), count, {}});
      }
      if (words[0] == "property") {
        if (elements.empty()) fail(shown(line_), "an element before its properties");
        elements.back().properties.push_back(ply_property(words));
      }
    }
    if (format != "ascii" && format != "binary_little_endian" && format != "binary_big_endian")
      fail("the format " + shown(format), "ascii, binary_little_endian or binary_big_endian");
    for (const PlyElement& element : elements) {
      const bool vertices = element.name == "vertex";
      for (const PlyProperty& property : element.properties)
        if (property.is_list)
          throw InputError(path_, "a list in the element " + shown(element.name),
                           vertices ? "scalars only" : "the points before elements with lists");
      read_ply_element(element, format, vertices);
      if (vertices) return;
    }
    throw InputError(path_, "no element vertex", "points");
  }

  void read_ply_element(const PlyElement& element, const std::string& format, bool keep) {
    std::array<int, 6> column;
    static constexpr std::array<const char*, 6> names{"x", "y", "z", "nx", "ny", "nz"};
    for (std::size_t k = 0; keep && k < 6; ++k) {
      const auto found = std::find_if(element.properties.begin(), element.properties.end(),
                                      [&](const PlyProperty& p) { return p.name == names[k]; });
      if (found == element.properties.end())
        throw InputError(path_, std::string("no property ") + names[k] + " of the points",
                         "x y z and the normal nx ny nz");
      column[k] = static_cast<int>(found - element.properties.begin());
    }
    std::vector<double> row(element.properties.size());
    if (row.empty()) return;  // nothing to skip, however many there are
    for (long i = 0; i < element.count; ++i) {
      if (format == "ascii") {
        read_ply_line(row);
      } else {
        for (std::size_t k = 0; k < row.size(); ++k)
          row[k] = ply_scalar(element.properties[k], format == "binary_big_endian");
      }
      if (!keep) continue;
      points_.emplace_back(row[column[0]], row[column[1]], row[column[2]]);
      normals_.emplace_back(row[column[3]], row[column[4]], row[column[5]]);
    }
  }

  void read_ply_line(std::vector<double>& row) {
    if (!next_line()) fail("the end of the file", "more points");
    const auto words = words_of(line_);
    if (words.size() != row.size())
      fail(std::to_string(words.size()) + " numbers", std::to_string(row.size()));
    for (std::size_t k = 0; k < row.size(); ++k)
      if (!parse(words[k], row[k])) fail(shown(words[k]), "a number");
  }

  double ply_scalar(const PlyProperty& property, bool big_endian) {
    std::array<char, 8> bytes{};
    file_.read(bytes.data(), static_cast<std::streamsize>(property.size));
    if (!file_) throw InputError(path_, "the end of the file", "more points");
    const bool swap = big_endian != (std::endian::native == std::endian::big);
    if (swap) std::reverse(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(property.size));
    const auto as = [&]<class T>(T value) {
      std::memcpy(&value, bytes.data(), sizeof value);
      return static_cast<double>(value);
    };
    switch (property.size) {
      case 1:
        return property.kind == 'i' ? as(std::int8_t{}) : as(std::uint8_t{});
      case 2:
        return property.kind == 'i' ? as(std::int16_t{}) : as(std::uint16_t{});
      case 8:
        return as(double{});
      default:
        return property.kind == 'f'   ? as(float{})
               : property.kind == 'i' ? as(std::int32_t{})
                                      : as(std::uint32_t{});
    }
  }

  PointCloud finish() const {
    const auto count = static_cast<Eigen::Index>(points_.size());
    PointCloud cloud{MatrixX3(count, 3), MatrixX3(count, 3)};
    bool distinct = false;
    for (Eigen::Index i = 0; i < count; ++i) {
      const Vec3 &point = points_[i], &normal = normals_[i];
      const std::string which = path_ + ": point " + std::to_string(i + 1);
      if (!point.allFinite() || !normal.allFinite())
        throw InputError(which, "a number that is not finite", "finite coordinates and normal");
      const double length = normal.stableNorm();
      if (!(length > 0)) throw InputError(which, "no normal", "a normal of any length but zero");
      cloud.points.row(i) = (mm_per_unit_ * point).transpose();
      if (!cloud.points.row(i).allFinite())
        throw InputError(which, "a coordinate that is not finite in mm", "a smaller mm_per_unit");
      cloud.normals.row(i) = (normal / length).transpose();
      distinct = distinct || point != points_[0];
    }
    if (!distinct) throw InputError(path_, std::to_string(count) + " points", "at least two distinct points");
    return cloud;
  }

  std::string path_;
  double mm_per_unit_;
  std::ifstream file_;
  std::string line_;
  int line_number_ = 0;
  std::vector<Vec3> points_, normals_;
};

}  // namespace

PointCloud read_point_cloud(const std::string& path, double mm_per_unit) {
  return CloudReader(path, mm_per_unit).read();
}

}  // namespace rhytid
