// Gmsh MSH, ascii. Format: Gmsh reference manual, "File formats", MSH 4.1 and the legacy 2.2.
#include <cmath>
#include <sstream>
#include <unordered_map>

#include "sim/core/error.h"
#include "sim/mesh/mesh_text.h"
#include "sim/mesh/surface_builder.h"

namespace rhytid {
namespace {

constexpr long kTriangle = 2, kQuadrangle = 3;

/// What an element type that is not a first-order face is: passed over, or refused (curved faces).
const char* solid_or_line(long type) {
  switch (type) {
    case 15:
      return "points";
    case 1:
    case 8:
    case 26:
    case 27:
    case 28:
      return "lines";
    case 9:
    case 10:
    case 16:
    case 20:
    case 21:
    case 22:
    case 23:
    case 24:
    case 25:
      return nullptr;
    default:
      return "solid or other elements";
  }
}

class MshReader {
 public:
  MshReader(const std::string& path, double mm_per_unit)
      : path_(path), text_(read_mesh_bytes(path)), builder_(path, mm_per_unit, 1) {}

  TriangleSurface read() {
    while (next_line()) {
      std::string_view rest = line_;
      const std::string_view word = next_word(rest);
      if (word.empty() || word[0] != '$') continue;
      if (word == "$MeshFormat") {
        read_format();
      } else if (word == "$Nodes" || word == "$Elements") {
        if (version_ == 0) fail("'" + std::string(word) + "'", "$MeshFormat before it; is it a Gmsh file?");
        const bool nodes = word == "$Nodes";
        if (version_ == 2) {
          nodes ? read_nodes_2() : read_elements_2();
        } else {
          nodes ? read_nodes_4() : read_elements_4();
        }
        expect_end(nodes ? "$EndNodes" : "$EndElements");
      } else {
        skip_section("$End" + std::string(word.substr(1)));
      }
    }
    if (version_ == 0) throw InputError(path_ + ": no $MeshFormat section; is it a Gmsh MSH file?");
    // Elements may stand before the nodes they name.
    std::vector<long> polygon;
    for (const auto& [tag, corners] : faces_) {
      polygon.clear();
      for (const long corner : corners) {
        const auto found = index_of_.find(corner);
        if (found == index_of_.end())
          throw InputError(path_ + ": element " + std::to_string(tag), "node " + std::to_string(corner),
                           "a node of the file");
        polygon.push_back(found->second);
      }
      builder_.add_polygon(polygon);
    }
    TriangleSurface surface =
        builder_.finish(version_ == 2 ? "Gmsh MSH 2.2 (ascii)" : "Gmsh MSH 4.1 (ascii)");
    surface.vertex_numbers = std::move(node_tags_);
    for (const auto& [tag, corners] : faces_) surface.face_numbers.push_back(tag);
    return surface;
  }

 private:
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    throw InputError(path_ + ":" + std::to_string(line_number_), found, expected);
  }

  bool next_line() {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line_ = std::string_view(text_).substr(at_, end - at_);
    at_ = end + 1;
    ++line_number_;
    return true;
  }
  /// The next line that is not blank, inside a section.
  std::string_view data_line() {
    do {
      if (!next_line()) fail("the end of the file", "more lines of the section; is the file truncated?");
    } while (line_.find_first_not_of(" \t\r") == std::string_view::npos);
    return line_;
  }
  template <class Number>
  Number take(std::string_view& rest, const char* what) const {
    const std::string_view word = next_word(rest);
    Number value{};
    if (!parse(word, value))
      fail(word.empty() ? "nothing" : "'" + std::string(word.substr(0, 40)) + "'", what);
    return value;
  }
  long take_count(std::string_view& rest, const char* what) const {
    const long count = take<long>(rest, what);
    if (count < 0) fail(std::to_string(count), what);
    return count;
  }

  void expect_end(const std::string& end) {
    std::string_view rest = data_line();
    if (const std::string_view word = next_word(rest); word != end)
      fail("'" + std::string(word.substr(0, 40)) + "'", end);
  }
  void skip_section(const std::string& end) {
    const int begin = line_number_;
    while (next_line()) {
      std::string_view rest = line_;
      if (next_word(rest) == end) return;
    }
    throw InputError(path_ + ":" + std::to_string(begin), "a section without an end", end);
  }

  void read_format() {
    std::string_view rest = data_line();
    const std::string_view version = next_word(rest);
    if (version != "2.2" && version != "4.1" && version != "2")
      fail("MSH version '" + std::string(version.substr(0, 40)) + "'", "2.2 or 4.1 (Gmsh: File > Export)");
    if (take<long>(rest, "the file type, 0 for ascii") != 0)
      fail("a binary MSH file", "ascii (Gmsh: -format msh41, without -bin)");
    version_ = version[0] == '2' ? 2 : 4;
    expect_end("$EndMeshFormat");
  }

  void add_node(long tag, std::string_view rest) {
    Vec3 position;
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = take<double>(rest, "three coordinates");
      if (!std::isfinite(position[axis])) fail("a coordinate that is not finite", "a finite one");
    }
    if (!index_of_.try_emplace(tag, builder_.num_vertices()).second)
      fail("node " + std::to_string(tag) + " a second time", "a tag of its own for every node");
    node_tags_.push_back(tag);
    builder_.add_vertex(position);
  }
  /// The nodes of an element of `type`, from the rest of its line.
  void add_element(long tag, long type, std::string_view rest) {
    if (type != kTriangle && type != kQuadrangle) {
      const char* what = solid_or_line(type);
      if (what == nullptr)
        fail("a curved face (element type " + std::to_string(type) + ")",
             "triangles and quadrangles of first order (Gmsh: -order 1)");
      builder_.pass_over(what);
      return;
    }
    std::vector<long> corners;
    for (long k = 0; k < (type == kTriangle ? 3 : 4); ++k) corners.push_back(take<long>(rest, "a node tag"));
    faces_.emplace_back(tag, std::move(corners));
  }

  void read_nodes_2() {
    std::string_view rest = data_line();
    const long count = take_count(rest, "the number of nodes");
    for (long k = 0; k < count; ++k) {
      rest = data_line();
      const long tag = take<long>(rest, "a node number");
      add_node(tag, rest);
    }
  }
  void read_elements_2() {
    std::string_view rest = data_line();
    const long count = take_count(rest, "the number of elements");
    for (long k = 0; k < count; ++k) {
      rest = data_line();
      const long tag = take<long>(rest, "an element number");
      const long type = take<long>(rest, "an element type");
      const long tags = take_count(rest, "a number of tags");
      for (long t = 0; t < tags; ++t) (void)take<long>(rest, "a tag");
      add_element(tag, type, rest);
    }
  }
  void read_nodes_4() {
    std::string_view rest = data_line();
    const long blocks = take_count(rest, "the number of entity blocks");
    for (long block = 0; block < blocks; ++block) {
      rest = data_line();
      for (const char* what : {"an entity's dimension", "an entity's tag", "0 or 1 for parametric"})
        (void)take<long>(rest, what);
      const long count = take_count(rest, "a number of nodes");
      std::vector<long> tags;
      for (long k = 0; k < count; ++k) {
        rest = data_line();
        tags.push_back(take<long>(rest, "a node tag"));
      }
      for (const long tag : tags) add_node(tag, data_line());  // parameters may follow the coordinates
    }
  }
  void read_elements_4() {
    std::string_view rest = data_line();
    const long blocks = take_count(rest, "the number of entity blocks");
    for (long block = 0; block < blocks; ++block) {
      rest = data_line();
      for (const char* what : {"an entity's dimension", "an entity's tag"}) (void)take<long>(rest, what);
      const long type = take<long>(rest, "an element type");
      const long count = take_count(rest, "a number of elements");
      for (long k = 0; k < count; ++k) {
        rest = data_line();
        const long tag = take<long>(rest, "an element tag");
        add_element(tag, type, rest);
      }
    }
  }

  std::string path_, text_;
  std::size_t at_ = 0;
  int line_number_ = 0, version_ = 0;
  std::string_view line_;
  std::unordered_map<long, long> index_of_;
  std::vector<long> node_tags_;
  std::vector<std::pair<long, std::vector<long>>> faces_;
  SurfaceBuilder builder_;
};

}  // namespace

TriangleSurface read_msh(const std::string& path, double mm_per_unit) {
  return MshReader(path, mm_per_unit).read();
}

}  // namespace rhytid
