// Stanford PLY. Format: G. Turk, "The PLY Polygon File Format" (1994); type names of both spellings.
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>

#include "sim/core/error.h"
#include "sim/mesh/mesh_text.h"
#include "sim/mesh/surface_builder.h"

namespace rhytid {
namespace {

enum class PlyType { i8, u8, i16, u16, i32, u32, f32, f64 };
enum class PlyFormat { ascii, little_endian, big_endian };

std::optional<PlyType> ply_type(std::string_view word) {
  constexpr std::array<std::array<std::string_view, 2>, 8> words{{{"char", "int8"},
                                                                  {"uchar", "uint8"},
                                                                  {"short", "int16"},
                                                                  {"ushort", "uint16"},
                                                                  {"int", "int32"},
                                                                  {"uint", "uint32"},
                                                                  {"float", "float32"},
                                                                  {"double", "float64"}}};
  for (std::size_t type = 0; type < words.size(); ++type)
    if (word == words[type][0] || word == words[type][1]) return static_cast<PlyType>(type);
  return std::nullopt;
}

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::f32;
  std::optional<PlyType> count_type;  ///< of a list
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  int find(std::string_view property) const {
    for (std::size_t k = 0; k < properties.size(); ++k)
      if (properties[k].name == property) return static_cast<int>(k);
    return -1;
  }
};

class PlyReader {
 public:
  PlyReader(const std::string& path, double mm_per_unit)
      : path_(path), bytes_(read_mesh_bytes(path)), builder_(path, mm_per_unit, 0) {}

  TriangleSurface read() {
    read_header();
    for (const PlyElement& element : elements_) {
      // Items without properties take no bytes: nothing would end the loop but their count.
      if (element.properties.empty()) continue;
      if (element.name == "vertex") {
        read_vertices(element);
      } else if (element.name == "face") {
        read_faces(element);
      } else {
        if (element.name == "tristrips")
          throw InputError(path_ + ": element 'tristrips': triangle strips are not read; save as faces");
        for (std::uint64_t item = 0; item < element.count; ++item) {
          read_item(element, item);
          builder_.pass_over("items of element '" + element.name + "'");
        }
      }
    }
    constexpr const char* formats[] = {"ascii PLY", "binary little-endian PLY", "binary big-endian PLY"};
    return builder_.finish(formats[static_cast<int>(format_)]);
  }

 private:
  [[noreturn]] void fail_header(const std::string& found, const std::string& expected) const {
    throw InputError(path_ + ":" + std::to_string(line_), found, expected);
  }
  [[noreturn]] void fail_item(const PlyElement& element, std::uint64_t item, const std::string& what) const {
    throw InputError(path_ + ": " + element.name + " " + std::to_string(item) + ": " + what);
  }

  std::string_view header_line() {
    const std::size_t end = bytes_.find('\n', at_);
    if (end == std::string::npos) fail_header("the end of the file in the header", "end_header");
    std::string_view line = std::string_view(bytes_).substr(at_, end - at_);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    at_ = end + 1;
    ++line_;
    return line;
  }

  void read_header() {
    if (bytes_.rfind("ply\n", 0) != 0 && bytes_.rfind("ply\r\n", 0) != 0)
      throw InputError(path_ + ": does not begin with a line 'ply'; is it a PLY file?");
    header_line();
    bool has_format = false;
    for (;;) {
      std::string_view rest = header_line();
      const std::string_view keyword = next_word(rest);
      if (keyword == "end_header") break;
      if (keyword == "comment" || keyword == "obj_info" || keyword.empty()) continue;
      if (keyword == "format") {
        read_format(rest);
        has_format = true;
      } else if (keyword == "element") {
        PlyElement element;
        element.name = next_word(rest);
        const std::string_view count = next_word(rest);
        if (element.name.empty() || !parse(count, element.count))
          fail_header("'" + std::string(count) + "'", "element NAME COUNT");
        elements_.push_back(std::move(element));
      } else if (keyword == "property") {
        read_property(rest);
      } else {
        fail_header("'" + std::string(keyword.substr(0, 40)) + "'",
                    "format, element, property, comment, obj_info or end_header");
      }
    }
    if (!has_format) throw InputError(path_ + ": no format line in the header");
  }

  void read_format(std::string_view rest) {
    const std::string_view word = next_word(rest);
    if (word == "ascii") {
      format_ = PlyFormat::ascii;
    } else if (word == "binary_little_endian") {
      format_ = PlyFormat::little_endian;
    } else if (word == "binary_big_endian") {
      format_ = PlyFormat::big_endian;
    } else {
      fail_header("format '" + std::string(word.substr(0, 40)) + "'",
                  "ascii, binary_little_endian or binary_big_endian");
    }
    const std::string_view version = next_word(rest);
    if (version != "1.0") fail_header("version '" + std::string(version.substr(0, 40)) + "'", "1.0");
  }

  void read_property(std::string_view rest) {
    if (elements_.empty()) fail_header("a property", "an element before it");
    PlyProperty property;
    std::string_view word = next_word(rest);
    if (word == "list") {
      property.count_type = ply_type(next_word(rest));
      if (!property.count_type || *property.count_type >= PlyType::f32)
        fail_header("a list without an integer count type", "property list COUNT_TYPE TYPE NAME");
      word = next_word(rest);
    }
    const std::optional<PlyType> type = ply_type(word);
    property.name = next_word(rest);
    if (!type || property.name.empty())
      fail_header("'" + std::string(word.substr(0, 40)) + "'",
                  "a property as TYPE NAME or list COUNT TYPE NAME");
    property.type = *type;
    elements_.back().properties.push_back(std::move(property));
  }

  template <class T>
  double take_binary(const PlyElement& element, std::uint64_t item) {
    if (bytes_.size() - at_ < sizeof(T)) fail_item(element, item, "the file ends here; is it truncated?");
    std::array<unsigned char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    if ((format_ == PlyFormat::big_endian) != (std::endian::native == std::endian::big))
      for (std::size_t k = 0; k < sizeof(T) / 2; ++k) std::swap(raw[k], raw[sizeof(T) - 1 - k]);
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return static_cast<double>(value);
  }

  /// The next number; every type fits a double exactly.
  double take(const PlyElement& element, std::uint64_t item, PlyType type) {
    if (format_ == PlyFormat::ascii) return take_word(element, item);
    switch (type) {
      case PlyType::i8:
        return take_binary<std::int8_t>(element, item);
      case PlyType::u8:
        return take_binary<std::uint8_t>(element, item);
      case PlyType::i16:
        return take_binary<std::int16_t>(element, item);
      case PlyType::u16:
        return take_binary<std::uint16_t>(element, item);
      case PlyType::i32:
        return take_binary<std::int32_t>(element, item);
      case PlyType::u32:
        return take_binary<std::uint32_t>(element, item);
      case PlyType::f32:
        return take_binary<float>(element, item);
      case PlyType::f64:
        return take_binary<double>(element, item);
    }
    return 0;
  }

  double take_word(const PlyElement& element, std::uint64_t item) {
    const std::size_t begin = bytes_.find_first_not_of(" \t\r\n", at_);
    if (begin == std::string::npos) fail_item(element, item, "the file ends here; is it truncated?");
    at_ = std::min(bytes_.find_first_of(" \t\r\n", begin), bytes_.size());
    const std::string_view word = std::string_view(bytes_).substr(begin, at_ - begin);
    double value = 0;
    if (!parse(word, value))
      fail_item(element, item, "got '" + std::string(word.substr(0, 40)) + "', expected a number");
    return value;
  }

  /// Reads all properties of an item: scalars into scalars_, the list `wanted` into list_.
  void read_item(const PlyElement& element, std::uint64_t item, int wanted = -1) {
    scalars_.assign(element.properties.size(), 0);
    for (int k = 0; k < static_cast<int>(element.properties.size()); ++k) {
      const PlyProperty& property = element.properties[k];
      if (!property.count_type) {
        scalars_[k] = take(element, item, property.type);
        continue;
      }
      const double count = take(element, item, *property.count_type);
      // Every entry takes at least a byte, so a count beyond the rest of the file is refused before it loops.
      if (!(count >= 0) || count != std::floor(count) || count > static_cast<double>(bytes_.size() - at_))
        fail_item(element, item, "a list '" + property.name + "' of impossible length");
      if (k == wanted) list_.clear();
      for (double entry = 0; entry < count; ++entry) {
        const double value = take(element, item, property.type);
        if (k == wanted) list_.push_back(value);
      }
    }
  }

  void read_vertices(const PlyElement& element) {
    const int axes[] = {element.find("x"), element.find("y"), element.find("z")};
    for (int axis = 0; axis < 3; ++axis)
      if (axes[axis] < 0 || element.properties[axes[axis]].count_type)
        throw InputError(path_ + ": element 'vertex' has no property '" + "xyz"[axis] + "'");
    for (std::uint64_t item = 0; item < element.count; ++item) {
      read_item(element, item);
      const Vec3 position(scalars_[axes[0]], scalars_[axes[1]], scalars_[axes[2]]);
      if (!position.allFinite()) fail_item(element, item, "a coordinate that is not finite");
      builder_.add_vertex(position);
    }
  }

  void read_faces(const PlyElement& element) {
    int corners = element.find("vertex_indices");
    if (corners < 0) corners = element.find("vertex_index");
    if (corners < 0 || !element.properties[corners].count_type)
      throw InputError(path_ + ": element 'face' has no list 'vertex_indices' or 'vertex_index'");
    std::vector<long> polygon;
    for (std::uint64_t item = 0; item < element.count; ++item) {
      read_item(element, item, corners);
      if (list_.size() < 3)
        fail_item(element, item, std::to_string(list_.size()) + " corners, expected at least three");
      polygon.clear();
      for (const double index : list_) {
        if (!(index >= 0 && index <= 4294967295.0) || index != std::floor(index))
          fail_item(element, item, "a vertex index that is not an integer from 0");
        polygon.push_back(static_cast<long>(index));
      }
      builder_.add_polygon(polygon);
    }
  }

  std::string path_, bytes_;
  std::size_t at_ = 0;
  int line_ = 0;
  PlyFormat format_ = PlyFormat::ascii;
  std::vector<PlyElement> elements_;
  std::vector<double> scalars_, list_;
  SurfaceBuilder builder_;
};

}  // namespace

TriangleSurface read_ply(const std::string& path, double mm_per_unit) {
  return PlyReader(path, mm_per_unit).read();
}

}  // namespace rhytid
