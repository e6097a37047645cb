#include "tools/ply_file.h"

#include <bit>
#include <cstdint>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"

namespace rhytid::tools {
namespace {

static_assert(std::endian::native == std::endian::little, "the header promises little-endian numbers");

template <class T>
void append(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

void write_ply(const std::string& path, const MatrixX3& vertices,
               const std::vector<std::array<int, 3>>& triangles, const std::vector<Rgb>& colours,
               const std::string& scalar_name, const VectorXd& scalar) {
  require(static_cast<Eigen::Index>(colours.size()) == vertices.rows() && scalar.size() == vertices.rows(),
          "write_ply: one colour and one scalar per vertex");
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                    std::to_string(vertices.rows()) +
                    "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n"
                    "property uchar green\nproperty uchar blue\nproperty double " +
                    scalar_name + "\nelement face " + std::to_string(triangles.size()) +
                    "\nproperty list uchar int vertex_indices\nend_header\n";
  for (Eigen::Index i = 0; i < vertices.rows(); ++i) {
    for (int k = 0; k < 3; ++k) append(out, vertices(i, k));
    for (const std::uint8_t channel : {colours[i].r, colours[i].g, colours[i].b}) append(out, channel);
    append(out, scalar[i]);
  }
  for (const auto& triangle : triangles) {
    append(out, std::uint8_t{3});
    for (const int vertex : triangle) append(out, static_cast<std::int32_t>(vertex));
  }
  write_file(path, out);
}

}  // namespace rhytid::tools
