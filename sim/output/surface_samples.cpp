#include "sim/output/surface_samples.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "sim/core/error.h"
#include "sim/output/surface_tessellation.h"
#include "sim/surface/project_to_surface.h"

namespace rhytid {

namespace {
constexpr int kSubdivision =
    4;  // of the faces that points are projected to; between its corners u, v are linear
}

SurfaceSamples::SurfaceSamples(const SkinMesh& mesh, const SampleLine& line, int count)
    : rows_(count), columns_(1) {
  require(count >= 3, "SurfaceSamples: at least three points");
  require((line.to - line.from).norm() > 0, "SurfaceSamples: the ends of the line must differ");
  std::vector<Vec3> wanted;
  for (int i = 0; i < count; ++i) wanted.push_back(line.from + (line.to - line.from) * i / (count - 1));
  place(mesh, wanted, (line.to - line.from).norm() / (count - 1));
}

SurfaceSamples::SurfaceSamples(const SkinMesh& mesh, const SampleWindow& window, double spacing) {
  require(spacing > 0 && window.size.minCoeff() >= 2 * spacing,
          "SurfaceSamples: a window of at least 3 x 3 points");
  const Vec3 first = window.along.normalized(), second = window.normal.cross(first).normalized();
  // A quotient of decimals may lie just below the number that is meant: 0.6 / 0.2 = 2.9999999999999996.
  const auto intervals = [&](double size) { return static_cast<int>(std::floor(size / spacing + 1e-9)); };
  rows_ = 1 + intervals(window.size[0]);
  columns_ = 1 + intervals(window.size[1]);
  std::vector<Vec3> wanted;
  for (int j = 0; j < columns_; ++j)
    for (int i = 0; i < rows_; ++i)
      wanted.push_back(window.centre +
                       spacing * ((i - 0.5 * (rows_ - 1)) * first + (j - 0.5 * (columns_ - 1)) * second));
  place(mesh, wanted, spacing);
}

void SurfaceSamples::place(const SkinMesh& mesh, const std::vector<Vec3>& wanted, double nominal) {
  const SubdividedSurface surface(mesh, SurfaceSide::outer, kSubdivision);
  const MatrixX3 rest = surface.positions({});
  const TriangleBasis basis(mesh.order);
  const int per_face = mesh.nodes_per_face();
  std::vector<Vec3> found;
  for (const Vec3& x : wanted) {
    Point point;
    const SurfacePoint at = project_to_surface(rest, surface.triangles(), x);
    double u = 0, v = 0;
    const auto& corners = surface.triangles()[at.triangle];
    for (int k = 0; k < 3; ++k) {
      u += at.barycentric[k] * surface.vertices()[corners[k]].u;
      v += at.barycentric[k] * surface.vertices()[corners[k]].v;
    }
    const int face = surface.face_of_triangle(at.triangle);
    point.weights.resize(per_face);
    basis.evaluate(u, v, point.weights.data(), nullptr, nullptr);
    point.nodes = mesh.outer_nodes(face);
    Vec3 normal = Vec3::Zero();
    for (int k = 0; k < per_face; ++k)
      normal +=
          point.weights[k] * mesh.column_normals.row(mesh.face_columns[face * per_face + k]).transpose();
    point.normal = normal.normalized();
    // Beside the surface: the way there leads sideways, by more than normals of facets differ from smoothed
    // ones.
    const Vec3 way = x - at.point;
    const double sideways = (way - way.dot(point.normal) * point.normal).norm();
    const bool beside = sideways > 0.5 * nominal && sideways > 0.25 * way.norm();
    if (beside) point.nodes.clear(), ++missing_;
    places_.push_back(beside ? Place{} : Place{face, u, v});
    found.push_back(beside ? Vec3::Constant(std::numeric_limits<double>::quiet_NaN()) : at.point);
    points_.push_back(std::move(point));
  }
  double sum = 0;
  int pairs = 0;
  for (int j = 0; j < columns_; ++j)
    for (int i = 0; i < rows_; ++i)
      for (const bool across : {false, true}) {
        if (across ? j + 1 >= columns_ : i + 1 >= rows_) continue;
        const double d = (found[j * rows_ + i + (across ? rows_ : 1)] - found[j * rows_ + i]).norm();
        if (std::isfinite(d)) sum += d, ++pairs;
      }
  spacing_ = pairs > 0 ? sum / pairs : nominal;
}

MatrixXd SurfaceSamples::heights(const VectorXd& displacement) const {
  MatrixXd h(rows_, columns_);
  for (std::size_t p = 0; p < points_.size(); ++p) {
    const Point& point = points_[p];
    double height = point.nodes.empty() ? std::numeric_limits<double>::quiet_NaN() : 0;
    for (std::size_t k = 0; k < point.nodes.size(); ++k)
      height += point.weights[k] * point.normal.dot(displacement.segment<3>(3 * point.nodes[k]));
    h(static_cast<Eigen::Index>(p) % rows_, static_cast<Eigen::Index>(p) / rows_) = height;
  }
  return h;
}

void SurfaceSamples::add_transpose(const MatrixXd& weights, VectorXd& u_bar) const {
  require(weights.rows() == rows_ && weights.cols() == columns_, "SurfaceSamples: one weight per point");
  for (std::size_t p = 0; p < points_.size(); ++p) {
    const Point& point = points_[p];
    const double weight = weights(static_cast<Eigen::Index>(p) % rows_, static_cast<Eigen::Index>(p) / rows_);
    for (std::size_t k = 0; k < point.nodes.size(); ++k)
      u_bar.segment<3>(3 * point.nodes[k]) += (weight * point.weights[k]) * point.normal;
  }
}

}  // namespace rhytid
