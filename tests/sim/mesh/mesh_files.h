// The same small surface in every format, written here independently of the readers.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "sim/mesh/triangle_surface.h"

namespace rhytid::testing_support {

/// Bytes of a number, in the order asked for.
template <class T>
std::string bytes_of(T value, bool big_endian = false) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return big_endian ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
}

inline std::string write_file(const std::string& name, const std::string& bytes) {
  // Tests of one name run beside each other.
  const std::string path = testing::TempDir() + "rhytid_" + std::to_string(::getpid()) + "_" + name;
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

/// A wavy patch of triangles with coordinates that a float holds exactly.
inline TriangleSurface wavy_patch() {
  TriangleSurface surface = grid_surface(80, 64, 5, 4, GridPattern::union_jack);
  for (int v = 0; v < surface.vertices.rows(); ++v) surface.vertices(v, 2) = 0.25 * (v % 3);
  return surface;
}

inline std::string as_obj(const TriangleSurface& s) {
  std::ostringstream out;
  out << "# patch\n";
  for (int v = 0; v < s.vertices.rows(); ++v) out << "v " << s.vertices.row(v) << "\n";
  for (const auto& [a, b, c] : s.faces) out << "f " << a + 1 << " " << b + 1 << "//1 " << c + 1 << "\n";
  return out.str();
}

/// `format`: "ascii", "binary_little_endian" or "binary_big_endian". Has a colour per vertex, a quality per
/// face and an element of its own between, all to be passed over.
inline std::string as_ply(const TriangleSurface& s, const std::string& format) {
  const bool ascii = format == "ascii", big = format == "binary_big_endian";
  std::ostringstream out;
  out << "ply\nformat " << format << " 1.0\ncomment made by a test\nelement vertex " << s.vertices.rows()
      << "\nproperty float x\nproperty double y\nproperty float32 z\nproperty uchar red\n"
      << "element material 2\nproperty list uint8 short entries\nproperty int8 kind\n"
      << "element face " << s.faces.size()
      << "\nproperty float quality\nproperty list uchar int vertex_indices\nend_header\n";
  for (int v = 0; v < s.vertices.rows(); ++v) {
    const Vec3 x = s.vertices.row(v);
    if (ascii) {
      out << x[0] << " " << x[1] << " " << x[2] << " 200\n";
    } else {
      out << bytes_of(static_cast<float>(x[0]), big) << bytes_of(x[1], big)
          << bytes_of(static_cast<float>(x[2]), big) << '\xc8';
    }
  }
  for (int m = 0; m < 2; ++m) {
    if (ascii) {
      out << m << (m ? " -7 " : " ") << "3\n";
    } else {
      out << static_cast<char>(m);
      if (m) out << bytes_of(std::int16_t{-7}, big);
      out << '\x03';
    }
  }
  for (const auto& face : s.faces) {
    if (ascii) {
      out << "0.5 3 " << face[0] << " " << face[1] << " " << face[2] << "\n";
    } else {
      out << bytes_of(0.5f, big) << '\x03';
      for (const int v : face) out << bytes_of(std::int32_t{v}, big);
    }
  }
  return out.str();
}

inline std::string glb_container(const nlohmann::json& root, std::string binary) {
  std::string text = root.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  const auto word = [](std::size_t n) { return bytes_of(static_cast<std::uint32_t>(n)); };
  return "glTF" + word(2) + word(12 + 8 + text.size() + 8 + binary.size()) + word(text.size()) + "JSON" +
         text + word(binary.size()) + std::string("BIN\0", 4) + binary;
}

/// Interleaved positions and normals, 16-bit indices. `node`: what the one node says beside its mesh.
inline std::string as_glb(const TriangleSurface& s, nlohmann::json node = nlohmann::json::object()) {
  std::string binary;
  for (int v = 0; v < s.vertices.rows(); ++v) {
    for (int axis = 0; axis < 3; ++axis) binary += bytes_of(static_cast<float>(s.vertices(v, axis)));
    for (const float n : {0.f, 0.f, 1.f}) binary += bytes_of(n);
  }
  const std::size_t positions = binary.size(), indices = 6 * s.faces.size();
  for (const auto& face : s.faces)
    for (const int v : face) binary += bytes_of(static_cast<std::uint16_t>(v));
  node["mesh"] = 0;
  nlohmann::json root = {
      {"asset", {{"version", "2.0"}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {1}}}}},
      {"nodes", {node, {{"children", {0}}}}},
      {"buffers", {{{"byteLength", binary.size()}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", positions}, {"byteStride", 24}},
        {{"buffer", 0}, {"byteOffset", positions}, {"byteLength", indices}}}},
      {"accessors",
       {{{"bufferView", 0}, {"componentType", 5126}, {"count", s.vertices.rows()}, {"type", "VEC3"}},
        {{"bufferView", 1}, {"componentType", 5123}, {"count", 3 * s.faces.size()}, {"type", "SCALAR"}}}},
      {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}}}}};
  return glb_container(root, binary);
}

/// Node tags 10, 20, 30, ...; element tags from 101, after a point and a line.
inline std::string as_msh(const TriangleSurface& s, int version) {
  std::ostringstream out;
  const int nodes = static_cast<int>(s.vertices.rows()), faces = static_cast<int>(s.faces.size());
  if (version == 2) {
    out << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 1 "
           "\"skin\"\n$EndPhysicalNames\n$Nodes\n"
        << nodes << "\n";
    for (int v = 0; v < nodes; ++v) out << 10 * (v + 1) << " " << s.vertices.row(v) << "\n";
    out << "$EndNodes\n$Elements\n" << faces + 2 << "\n99 15 2 0 1 10\n100 1 2 0 1 10 20\n";
    for (int f = 0; f < faces; ++f) {
      out << 101 + f << " 2 2 1 7";
      for (const int v : s.faces[f]) out << " " << 10 * (v + 1);
      out << "\n";
    }
  } else {
    out << "$MeshFormat\r\n4.1 0 8\r\n$EndMeshFormat\r\n$Nodes\n2 " << nodes << " 10 " << 10 * nodes
        << "\n0 1 0 1\n10\n"
        << s.vertices.row(0) << "\n2 1 1 " << nodes - 1 << "\n";
    for (int v = 1; v < nodes; ++v) out << 10 * (v + 1) << "\n";
    for (int v = 1; v < nodes; ++v) out << s.vertices.row(v) << " 0.25 0.75\n";
    out << "$EndNodes\n$Elements\n2 " << faces + 1 << " 100 " << 100 + faces << "\n1 1 1 1\n100 10 20\n2 1 2 "
        << faces << "\n";
    for (int f = 0; f < faces; ++f) {
      out << 101 + f;
      for (const int v : s.faces[f]) out << " " << 10 * (v + 1);
      out << "\n";
    }
  }
  out << "$EndElements\n";
  return out.str();
}

struct MeshFile {
  std::string extension, bytes;
};
/// The patch in every format.
inline std::vector<MeshFile> every_format(const TriangleSurface& s) {
  return {{"obj", as_obj(s)},
          {"ply", as_ply(s, "ascii")},
          {"ply", as_ply(s, "binary_little_endian")},
          {"ply", as_ply(s, "binary_big_endian")},
          {"glb", as_glb(s)},
          {"msh", as_msh(s, 2)},
          {"msh", as_msh(s, 4)}};
}

}  // namespace rhytid::testing_support
