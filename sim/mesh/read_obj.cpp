#include <cmath>
#include <limits>
#include <sstream>
#include <string_view>

#include "sim/core/error.h"
#include "sim/mesh/mesh_text.h"
#include "sim/mesh/surface_builder.h"

namespace rhytid {
namespace {

class ObjReader {
 public:
  ObjReader(const std::string& path, double mm_per_unit) : path_(path), builder_(path, mm_per_unit, 1) {}

  TriangleSurface read() {
    std::istringstream file(read_mesh_bytes(path_));
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
    builder_.add_vertex(position);  // a weight or colour that follows is of no use here
  }

  void read_face(std::string_view rest) {
    std::vector<long> corners;
    for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest))
      corners.push_back(read_corner(word));
    if (corners.size() < 3)
      fail("a face with " + std::to_string(corners.size()) + " corners", "at least three");
    for (const long vertex : corners)
      if (vertex > largest_) {
        largest_ = vertex;
        largest_line_ = line_;
      }
    builder_.add_polygon(corners);
  }

  // v, v/vt, v//vn or v/vt/vn. Only v is used, but what follows must be numbers too.
  long read_corner(std::string_view word) const {
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
    const long count = builder_.num_vertices();
    if (index == 0) fail("vertex index 0", "indices from 1, or negative ones counting back");
    if (index < -count)
      fail("vertex index " + std::to_string(index),
           "at least -" + std::to_string(count) + " (vertices so far)");
    if (index > std::numeric_limits<int>::max())
      fail("vertex index " + std::to_string(index), "a smaller number");
    return index > 0 ? index - 1 : count + index;
  }

  TriangleSurface finish() {
    const long count = builder_.num_vertices();
    if (count > 0 && largest_ >= count) {
      line_ = largest_line_;
      fail("vertex index " + std::to_string(largest_ + 1),
           "1.." + std::to_string(count) + ", the file's vertices");
    }
    return builder_.finish("Wavefront OBJ");
  }

  std::string path_;
  SurfaceBuilder builder_;
  int line_ = 0, largest_line_ = 0;
  long largest_ = -1;
};

}  // namespace

TriangleSurface read_obj(const std::string& path, double mm_per_unit) {
  return ObjReader(path, mm_per_unit).read();
}

}  // namespace rhytid
