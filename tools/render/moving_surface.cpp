#include "tools/render/moving_surface.h"

#include <Eigen/Geometry>
#include <array>
#include <cstring>
#include <nlohmann/json.hpp>

#include "sim/core/error.h"
#include "sim/element/basis.h"
#include "sim/output/atomic_file.h"

namespace rhytid::tools {
namespace {

using nlohmann::json;

/// Takes doubles from the end of a file's text.
class Doubles {
 public:
  Doubles(const std::string& bytes, size_t begin, const std::string& path)
      : bytes_(bytes), at_(begin), path_(path) {}
  void read(double* out, size_t count) {
    if (bytes_.size() - at_ < count * sizeof(double))
      throw InputError(path_, "a file that ends early", "the motion of a surface");
    std::memcpy(out, bytes_.data() + at_, count * sizeof(double));
    at_ += count * sizeof(double);
  }
  bool at_end() const { return at_ == bytes_.size(); }

 private:
  const std::string& bytes_;
  size_t at_;
  const std::string& path_;
};

std::string_view bytes_of(const double* data, size_t count) {
  return {reinterpret_cast<const char*>(data), count * sizeof(double)};
}

}  // namespace

Vec3 MovingSurface::position(const MaterialPoint& point, int frame, Vec3* x_u, Vec3* x_v) const {
  require(point.face >= 0 && point.face < mesh.num_faces, "MovingSurface: face out of range");
  require(frame >= -1 && frame < frames(), "MovingSurface: frame out of range");
  const size_t size = static_cast<size_t>(mesh.nodes_per_face());
  std::vector<double> n(size), n_u(size), n_v(size);
  TriangleBasis(mesh.order).evaluate(point.u, point.v, n.data(), n_u.data(), n_v.data());
  Vec3 x = Vec3::Zero(), du = Vec3::Zero(), dv = Vec3::Zero();
  for (size_t k = 0; k < size; ++k) {
    const int column = mesh.face_columns[static_cast<size_t>(point.face) * size + k];
    Vec3 node = mesh.rest.row(column).transpose();
    if (frame >= 0) node += displacements[static_cast<size_t>(frame)].segment<3>(3 * column);
    x += n[k] * node, du += n_u[k] * node, dv += n_v[k] * node;
  }
  if (x_u != nullptr) *x_u = du;
  if (x_v != nullptr) *x_v = dv;
  return x;
}

Vec3 MovingSurface::rest(const MaterialPoint& point) const {
  return position(point, -1);
}

Vec3 MovingSurface::mean_normal() const {
  Vec3 sum = Vec3::Zero();
  const size_t size = static_cast<size_t>(mesh.nodes_per_face());
  for (size_t face = 0; face < static_cast<size_t>(mesh.num_faces); ++face) {
    std::array<Vec3, 3> x;
    for (size_t i = 0; i < 3; ++i) x[i] = mesh.rest.row(mesh.face_columns[face * size + i]).transpose();
    sum += (x[1] - x[0]).cross(x[2] - x[0]);
  }
  return sum.normalized();
}

MovingSurface outer_surface(const SkinMesh& skin, const std::string& scene) {
  MovingSurface out;
  out.scene = scene;
  out.mesh.order = skin.order;
  out.mesh.num_columns = skin.num_columns;
  out.mesh.num_levels = 1;
  out.mesh.num_faces = skin.num_faces;
  out.mesh.face_columns = skin.face_columns;
  out.mesh.rim_columns = skin.rim_columns;
  out.mesh.rest.resize(skin.num_columns, 3);
  for (int c = 0; c < skin.num_columns; ++c)
    out.mesh.rest.row(c) = skin.rest.row(skin.node(c, skin.num_levels - 1));
  return out;
}

VectorXd outer_displacement(const SkinMesh& skin, const VectorXd& u) {
  VectorXd out(3 * skin.num_columns);
  for (int c = 0; c < skin.num_columns; ++c)
    out.segment<3>(3 * c) = u.segment<3>(3 * skin.node(c, skin.num_levels - 1));
  return out;
}

void write_motion(const MovingSurface& surface, const std::string& path) {
  const SkinMesh& mesh = surface.mesh;
  const json header = {{"format", "rhytid motion 1"}, {"order", mesh.order},
                       {"columns", mesh.num_columns}, {"faces", mesh.num_faces},
                       {"frames", surface.frames()},  {"face_columns", mesh.face_columns},
                       {"scene", surface.scene}};
  AtomicFile file(path);
  file.write(header.dump() + "\n");
  const MatrixX3 rest = mesh.rest;
  for (int c = 0; c < mesh.num_columns; ++c) {
    const Vec3 x = rest.row(c).transpose();
    file.write(bytes_of(x.data(), 3));
  }
  for (int f = 0; f < surface.frames(); ++f) {
    const VectorXd& u = surface.displacements[static_cast<size_t>(f)];
    file.write(bytes_of(&surface.times[static_cast<size_t>(f)], 1));
    file.write(bytes_of(u.data(), static_cast<size_t>(u.size())));
  }
  file.commit();
}

MovingSurface read_motion(const std::string& path) {
  const std::string bytes = read_file(path);
  const size_t line_end = bytes.find('\n');
  const json header = json::parse(bytes.substr(0, line_end), nullptr, false);
  if (line_end == std::string::npos || !header.is_object() || header.value("format", "") != "rhytid motion 1")
    throw InputError(path, "another kind of file", "the motion of a surface, as written by render");
  MovingSurface surface;
  SkinMesh& mesh = surface.mesh;
  int frames = 0;
  try {
    mesh.order = header.at("order"), mesh.num_columns = header.at("columns");
    mesh.num_faces = header.at("faces"), mesh.num_levels = 1;
    mesh.face_columns = header.at("face_columns").get<std::vector<int>>();
    frames = header.at("frames"), surface.scene = header.at("scene");
  } catch (const json::exception& error) {
    throw InputError(path, error.what(), "the motion of a surface, as written by render");
  }
  Doubles doubles(bytes, line_end + 1, path);
  mesh.rest.resize(mesh.num_columns, 3);
  for (int c = 0; c < mesh.num_columns; ++c) {
    Vec3 x;
    doubles.read(x.data(), 3);
    mesh.rest.row(c) = x.transpose();
  }
  for (int f = 0; f < frames; ++f) {
    double time = 0;
    VectorXd u(3 * mesh.num_columns);
    doubles.read(&time, 1);
    doubles.read(u.data(), static_cast<size_t>(u.size()));
    surface.times.push_back(time);
    surface.displacements.push_back(std::move(u));
  }
  if (!doubles.at_end()) throw InputError(path, "more bytes than its header says", "a complete file");
  return surface;
}

}  // namespace rhytid::tools
