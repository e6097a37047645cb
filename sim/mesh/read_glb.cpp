// glTF 2.0 binary. Format: Khronos glTF 2.0 specification, sections 3.5 (scenes), 3.6 (buffers, accessors),
// 3.7 (geometry) and 4 (GLB). The JSON part is read by the JSON library that scenes use.
#include <Eigen/Geometry>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>

#include "sim/core/error.h"
#include "sim/mesh/surface_builder.h"

namespace rhytid {
namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little,
              "GLB numbers are little-endian and copied as they are");

/// A run of equally spaced items in the binary chunk, checked against its end.
struct Accessor {
  const char* data = nullptr;
  std::size_t count = 0, stride = 0;
  int component_type = 0;

  template <class T>
  T read(std::size_t item, std::size_t component = 0) const {
    T value;
    std::memcpy(&value, data + item * stride + component * sizeof(T), sizeof(T));
    return value;
  }
  /// An index of any of the three types that the format allows.
  long index(std::size_t item) const {
    return component_type == 5121   ? read<std::uint8_t>(item)
           : component_type == 5123 ? read<std::uint16_t>(item)
                                    : static_cast<long>(read<std::uint32_t>(item));
  }
};

class GlbReader {
 public:
  GlbReader(const std::string& path, double mm_per_unit)
      : path_(path), bytes_(read_mesh_bytes(path)), builder_(path, mm_per_unit, 0) {}

  TriangleSurface read() {
    read_chunks();
    std::string extensions;
    if (root_.contains("extensionsRequired"))
      for (const auto& name : root_["extensionsRequired"])
        if (name.is_string()) extensions += " " + name.get<std::string>();
    if (!extensions.empty())
      fail("needs the extension" + extensions +
           ", which is not read; export without compression and quantisation");
    walk_scene();
    return builder_.finish("binary glTF 2.0");
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw InputError(path_ + ": " + what); }

  std::uint32_t word(std::size_t at) const {
    std::uint32_t value;
    std::memcpy(&value, bytes_.data() + at, 4);
    return value;
  }

  void read_chunks() {
    if (bytes_.size() < 12 || bytes_.compare(0, 4, "glTF") != 0)
      fail("does not begin with 'glTF'; is it a binary glTF file?");
    if (word(4) != 2) fail("version " + std::to_string(word(4)) + " of glTF, expected 2");
    if (word(8) > bytes_.size())
      fail("ends after " + std::to_string(bytes_.size()) + " of " + std::to_string(word(8)) +
           " bytes; is it truncated?");
    bool has_json = false;
    for (std::size_t at = 12; at + 8 <= word(8);) {
      const std::size_t length = word(at), begin = at + 8;
      if (length > word(8) - begin) fail("a chunk reaches beyond the end of the file");
      const std::string_view chunk = std::string_view(bytes_).substr(begin, length);
      if (word(at + 4) == 0x4E4F534A && !has_json) {
        root_ = json::parse(chunk, nullptr, false);
        if (root_.is_discarded() || !root_.is_object()) fail("its JSON chunk cannot be parsed");
        has_json = true;
      } else if (word(at + 4) == 0x004E4942 && binary_.empty()) {
        binary_ = chunk;
      }
      at = begin + length;
    }
    if (!has_json) fail("no JSON chunk");
  }

  /// Item `index` of the list `name`.
  const json& item(const char* name, long index) const {
    const auto list = root_.find(name);
    if (list == root_.end() || !list->is_array() || index < 0 || index >= static_cast<long>(list->size()))
      fail(std::string("names item ") + std::to_string(index) + " of /" + name + ", which does not exist");
    const json& found = (*list)[static_cast<std::size_t>(index)];
    if (!found.is_object()) fail(std::string("/") + name + "/" + std::to_string(index) + " is not an object");
    return found;
  }
  long integer(const json& holder, const char* key, long fallback) const {
    const auto found = holder.find(key);
    if (found == holder.end()) return fallback;
    if (!found->is_number()) fail(std::string("the value of '") + key + "' is not a number");
    const double value = found->get<double>();
    if (!(value >= 0 && value < 9e15) || value != std::floor(value))
      fail(std::string("the value of '") + key + "' is not an integer from 0");
    return static_cast<long>(value);
  }
  std::vector<double> numbers(const json& holder, const char* key, std::vector<double> fallback) const {
    const auto found = holder.find(key);
    if (found == holder.end()) return fallback;
    bool good = found->is_array() && found->size() == fallback.size();
    for (std::size_t k = 0; good && k < fallback.size(); ++k) {
      good = (*found)[k].is_number();
      if (good) fallback[k] = (*found)[k].get<double>();
    }
    if (!good)
      fail(std::string("'") + key + "' of a node is not " + std::to_string(fallback.size()) + " numbers");
    return fallback;
  }
  std::vector<long> integers(const json& holder, const char* key) const {
    std::vector<long> list;
    const auto found = holder.find(key);
    if (found == holder.end()) return list;
    if (!found->is_array()) fail(std::string("'") + key + "' is not a list");
    for (const json& entry : *found) {
      if (!entry.is_number_unsigned()) fail(std::string("'") + key + "' holds more than integers from 0");
      list.push_back(static_cast<long>(entry.get<std::uint64_t>() & 0x7fffffffffffffff));
    }
    return list;
  }

  Eigen::Affine3d local_transform(const json& node) const {
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    if (node.contains("matrix")) {
      const std::vector<double> m = numbers(node, "matrix", std::vector<double>(16, 0.));
      transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(m.data());  // column-major, as in the file
      if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1) fail("'matrix' of a node is not affine");
      return transform;
    }
    const auto t = numbers(node, "translation", {0, 0, 0}), r = numbers(node, "rotation", {0, 0, 0, 1}),
               s = numbers(node, "scale", {1, 1, 1});
    const Eigen::Quaterniond rotation(r[3], r[0], r[1], r[2]);
    if (!(rotation.norm() > 0.5)) fail("'rotation' of a node is not a unit quaternion");
    transform =
        Eigen::Translation3d(t[0], t[1], t[2]) * rotation.normalized() * Eigen::Scaling(s[0], s[1], s[2]);
    return transform;
  }

  void walk_scene() {
    std::vector<long> roots;
    if (root_.contains("scenes")) {
      roots = integers(item("scenes", integer(root_, "scene", 0)), "nodes");
    } else if (root_.contains("nodes") && root_["nodes"].is_array()) {
      std::vector<char> is_child(root_["nodes"].size(), 0);
      for (std::size_t n = 0; n < is_child.size(); ++n)
        for (const long child : integers(item("nodes", static_cast<long>(n)), "children"))
          if (child < static_cast<long>(is_child.size())) is_child[child] = 1;
      for (std::size_t n = 0; n < is_child.size(); ++n)
        if (!is_child[n]) roots.push_back(static_cast<long>(n));
    }
    std::vector<std::pair<long, Eigen::Affine3d>> pending;
    for (auto root = roots.rbegin(); root != roots.rend(); ++root)
      pending.emplace_back(*root, Eigen::Affine3d::Identity());
    std::vector<char> visited;
    while (!pending.empty()) {
      const auto [index, parent] = pending.back();
      pending.pop_back();
      const json& node = item("nodes", index);
      visited.resize(root_["nodes"].size(), 0);
      if (visited[index]) fail("node " + std::to_string(index) + " hangs on two nodes");  // or a cycle
      visited[index] = 1;
      const Eigen::Affine3d transform = parent * local_transform(node);
      if (node.contains("mesh")) {
        if (node.contains("skin")) builder_.pass_over("skeletons (the rest pose is read)");
        const json& mesh = item("meshes", integer(node, "mesh", 0));
        refuse_weights(node.contains("weights") ? node : mesh);
        read_mesh(mesh, transform);
      }
      const std::vector<long> children = integers(node, "children");
      for (auto child = children.rbegin(); child != children.rend(); ++child)
        pending.emplace_back(*child, transform);
    }
  }

  Accessor accessor(long index, const char* type, int components) const {
    const json& source = item("accessors", index);
    const std::string name = "accessor " + std::to_string(index);
    if (source.contains("sparse")) fail(name + " is sparse, which is not read; export whole arrays");
    if (!source.contains("bufferView")) fail(name + " has no bufferView");
    if (!source.contains("type") || source["type"] != type) fail(name + " is not a " + type);
    Accessor result;
    result.component_type = static_cast<int>(integer(source, "componentType", 0));
    const bool is_index = components == 1;
    const int type_code = result.component_type;
    if (!(is_index ? type_code == 5121 || type_code == 5123 || type_code == 5125 : type_code == 5126))
      fail(name + " has component type " + std::to_string(type_code) +
           (is_index ? ", expected unsigned integers" : ", expected 5126 (float)"));
    const std::size_t width = type_code == 5121 ? 1 : type_code == 5123 ? 2 : 4, size = width * components;
    const json& view = item("bufferViews", integer(source, "bufferView", 0));
    if (integer(view, "buffer", 0) != 0 || item("buffers", 0).contains("uri"))
      fail(name + " lies outside the file's own binary chunk");
    const std::size_t view_begin = integer(view, "byteOffset", 0),
                      view_length = integer(view, "byteLength", 0), begin = integer(source, "byteOffset", 0);
    result.count = integer(source, "count", 0);
    result.stride = integer(view, "byteStride", static_cast<long>(size));
    // Each number is below 9e15, so their sums stay in range; products are compared by division.
    const bool inside = view_begin + view_length <= binary_.size() && result.stride >= size &&
                        result.stride <= 4096 && result.count >= 1 && begin + size <= view_length &&
                        (view_length - begin - size) / result.stride >= result.count - 1;
    if (!inside) fail(name + " reaches beyond its data; is the file truncated?");
    result.data = binary_.data() + view_begin + begin;
    return result;
  }

  /// Shapes blended into the surface are not read: without weights they are not there.
  void refuse_weights(const json& holder) const {
    if (!holder.contains("weights") || !holder["weights"].is_array()) return;
    for (const json& weight : holder["weights"])
      if (weight.is_number() && weight.get<double>() != 0)
        fail("morph targets with weights, which are not read; export the shape they make");
  }

  void read_mesh(const json& mesh, const Eigen::Affine3d& transform) {
    if (!mesh.contains("primitives") || !mesh["primitives"].is_array()) fail("a mesh without primitives");
    for (const json& primitive : mesh["primitives"]) {
      if (!primitive.is_object() || !primitive.contains("attributes") || !primitive["attributes"].is_object())
        fail("a primitive without attributes");
      const long mode = integer(primitive, "mode", 4);
      if (mode < 4) {
        builder_.pass_over("primitives of points or lines");
        continue;
      }
      if (mode > 6) fail("a primitive of mode " + std::to_string(mode) + ", expected 0 to 6");
      if (!primitive["attributes"].contains("POSITION")) continue;  // nothing to draw, by the specification
      if (primitive.contains("targets")) builder_.pass_over("morph targets (the shape without them is read)");
      read_primitive(primitive, mode, transform);
    }
  }

  void read_primitive(const json& primitive, long mode, const Eigen::Affine3d& transform) {
    const long first = builder_.num_vertices();
    const Accessor positions = accessor(integer(primitive["attributes"], "POSITION", 0), "VEC3", 3);
    // Meshes may be placed many times over: what that may add up to is bounded.
    if (first + positions.count > 30'000'000) fail("more than 30 million vertices");
    for (std::size_t v = 0; v < positions.count; ++v)
      builder_.add_vertex(transform * Eigen::Vector3f(positions.read<float>(v, 0),
                                                      positions.read<float>(v, 1),
                                                      positions.read<float>(v, 2))
                                          .cast<double>());
    std::vector<long> corners;
    if (primitive.contains("indices")) {
      const Accessor indices = accessor(integer(primitive, "indices", 0), "SCALAR", 1);
      for (std::size_t k = 0; k < indices.count; ++k) {
        const long index = indices.index(k);
        if (index >= static_cast<long>(positions.count))
          fail("index " + std::to_string(index) + " of a primitive with " + std::to_string(positions.count) +
               " vertices");
        corners.push_back(first + index);
      }
    } else {
      for (std::size_t v = 0; v < positions.count; ++v) corners.push_back(first + static_cast<long>(v));
    }
    add_triangles(corners, mode, transform.linear().determinant() < 0);
  }

  /// `mirrored`: a transform that turns the surface inside out swaps the winding (specification 3.5.3).
  void add_triangles(const std::vector<long>& c, long mode, bool mirrored) {
    if (builder_.num_polygons() + static_cast<long>(c.size()) > 30'000'000)
      fail("more than 30 million triangles");
    if (mode == 4 && c.size() % 3 != 0) fail("a primitive whose corners are not a multiple of three");
    const std::size_t count = mode == 4 ? c.size() / 3 : c.size() < 3 ? 0 : c.size() - 2;
    for (std::size_t t = 0; t < count; ++t) {
      std::vector<long> triangle = mode == 4   ? std::vector<long>{c[3 * t], c[3 * t + 1], c[3 * t + 2]}
                                   : mode == 5 ? std::vector<long>{c[t], c[t + 1 + t % 2], c[t + 2 - t % 2]}
                                               : std::vector<long>{c[t + 1], c[t + 2], c[0]};
      if (mode == 5 &&
          (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[0] == triangle[2]))
        continue;  // the joints of strips
      if (mirrored) std::swap(triangle[1], triangle[2]);
      builder_.add_polygon(triangle);
    }
  }

  std::string path_, bytes_;
  std::string_view binary_;
  json root_;
  SurfaceBuilder builder_;
};

}  // namespace

TriangleSurface read_glb(const std::string& path, double mm_per_unit) {
  return GlbReader(path, mm_per_unit).read();
}

}  // namespace rhytid
