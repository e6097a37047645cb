#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <string_view>

#include "sim/core/error.h"
#include "sim/mesh/triangle_surface.h"

namespace rhytid {
namespace {

std::string_view next_word(std::string_view& rest) {
  const std::size_t begin = rest.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) {
    rest = {};
    return {};
  }
  const std::size_t end = std::min(rest.find_first_of(" \t\r", begin), rest.size());
  const std::string_view word = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return word;
}

// Locale-free, unlike strtod and streams.
template <typename Number>
bool parse(std::string_view word, Number& value) {
  if (word.size() > 1 && word[0] == '+') word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

class ObjReader {
 public:
  ObjReader(const std::string& path, double mm_per_unit) : path_(path), mm_per_unit_(mm_per_unit) {}

  TriangleSurface read() {
    std::ifstream file(path_, std::ios::binary);
    if (!file) throw InputError(path_ + ": cannot be opened");
    std::string line, joined;
    while (std::getline(file, line)) {
      ++line_;
      if (!line.empty() && line.back() == '\r') line.pop_back();
      joined += line;
      if (!joined.empty() && joined.back() == '\\') {  // continued on the next line
        joined.back() = ' ';
        continue;
      }
      read_statement(joined);
      joined.clear();
    }
    if (file.bad()) throw InputError(path_ + ": reading failed after line " + std::to_string(line_));
    read_statement(joined);
    return finish();
  }

 private:
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw InputError(path_ + ":" + std::to_string(line_), found, expected);
  }

  void read_statement(std::string_view rest) {
    rest = rest.substr(0, rest.find('#'));
    const std::string_view keyword = next_word(rest);
    if (keyword == "v") read_vertex(rest);
    if (keyword == "f") read_face(rest);
  }

  void read_vertex(std::string_view rest) {
    Vec3 position;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view word = next_word(rest);
      if (word.empty()) fail("a vertex with " + std::to_string(axis) + " coordinates", "three");
      if (!parse(word, position[axis]) || !std::isfinite(position[axis]))
        fail("'" + std::string(word) + "'", "a finite coordinate");
    }
    vertices_.push_back(position);  // a weight or colour that follows is of no use here
  }

  void read_face(std::string_view rest) {
    std::vector<int> corners;
    for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest))
      corners.push_back(read_corner(word));
    if (corners.size() < 3)
      fail("a face with " + std::to_string(corners.size()) + " corners", "at least three");
    for (std::size_t k = 2; k < corners.size(); ++k) {
      surface_.faces.push_back({corners[0], corners[k - 1], corners[k]});
      surface_.source_face.push_back(polygons_);
      face_lines_.push_back(line_);
    }
    ++polygons_;
  }

  // v, v/vt, v//vn or v/vt/vn. Only v is used, but what follows must be numbers too.
  int read_corner(std::string_view word) const {
    long index = 0;
    std::string_view parts = word;
    for (int part = 0; part < 3; ++part) {
      const std::size_t slash = parts.find('/');
      const std::string_view text = parts.substr(0, slash);
      long number = 0;
      const bool may_be_empty = part == 1;
      if (!(text.empty() && may_be_empty) && !parse(text, number))
        fail("face corner '" + std::string(word) + "'", "v, v/vt, v//vn or v/vt/vn");
      if (part == 0) index = number;
      if (slash == std::string_view::npos) break;
      parts.remove_prefix(slash + 1);
      if (part == 2) fail("face corner '" + std::string(word) + "'", "at most three indices");
    }
    const long count = static_cast<long>(vertices_.size());
    if (index == 0) fail("vertex index 0", "indices from 1, or negative ones counting back");
    if (index < -count)
      fail("vertex index " + std::to_string(index),
           "at least -" + std::to_string(count) + " (vertices so far)");
    if (index > std::numeric_limits<int>::max())
      fail("vertex index " + std::to_string(index), "a smaller number");
    return static_cast<int>(index > 0 ? index - 1 : count + index);
  }

  TriangleSurface finish() {
    const int count = static_cast<int>(vertices_.size());
    for (std::size_t face = 0; face < surface_.faces.size(); ++face) {
      for (const int vertex : surface_.faces[face]) {
        line_ = face_lines_[face];
        if (vertex >= count)
          fail("vertex index " + std::to_string(vertex + 1),
               "1.." + std::to_string(count) + ", the file's vertices");
      }
    }
    line_ = 0;
    if (count == 0) throw InputError(path_ + ": no vertices ('v' lines); is it a Wavefront OBJ file?");
    if (surface_.faces.empty()) throw InputError(path_ + ": no faces ('f' lines)");
    surface_.origin = path_;
    surface_.vertices.resize(count, 3);
    surface_.source_vertex.resize(count);
    for (int vertex = 0; vertex < count; ++vertex) {
      surface_.vertices.row(vertex) = mm_per_unit_ * vertices_[vertex];
      surface_.source_vertex[vertex] = vertex;
    }
    return std::move(surface_);
  }

  std::string path_;
  double mm_per_unit_;
  int line_ = 0, polygons_ = 0;
  std::vector<Vec3> vertices_;
  std::vector<int> face_lines_;
  TriangleSurface surface_;
};

}  // namespace

TriangleSurface read_obj(const std::string& path, double mm_per_unit) {
  require(mm_per_unit > 0 && std::isfinite(mm_per_unit), "read_obj: mm_per_unit must be positive");
  return ObjReader(path, mm_per_unit).read();
}

}  // namespace rhytid
