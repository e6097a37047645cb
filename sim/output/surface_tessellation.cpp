#include "sim/output/surface_tessellation.h"

#include <Eigen/Geometry>
#include <map>
#include <tuple>

#include "sim/core/error.h"

namespace rhytid {

namespace {

/// Names a point of the surface independently of the face it is seen from: a corner by its column, a point on
/// an edge by the edge's end columns and its position counted from the smaller one, an interior point by
/// itself.
using PointKey = std::tuple<int, int, int>;

PointKey edge_key(int column_a, int column_b, int steps_from_a, int subdivision) {
  return column_a < column_b ? PointKey{column_a, column_b, steps_from_a}
                             : PointKey{column_b, column_a, subdivision - steps_from_a};
}

/// Key of lattice point (i, j), 0 ≤ i + j ≤ n, of a face with the given corner columns.
PointKey point_key(const int* corners, int i, int j, int n, int vertex) {
  if (i + j == 0) return {corners[0], -1, 0};
  if (i == n) return {corners[1], -1, 0};
  if (j == n) return {corners[2], -1, 0};
  if (j == 0) return edge_key(corners[0], corners[1], i, n);
  if (i == 0) return edge_key(corners[0], corners[2], j, n);
  if (i + j == n) return edge_key(corners[1], corners[2], j, n);
  return {-1, -1, vertex};
}

}  // namespace

SubdividedSurface::SubdividedSurface(const SkinMesh& mesh, SurfaceSide side, int subdivision)
    : subdivision_(subdivision),
      nodes_per_face_(mesh.nodes_per_face()),
      num_nodes_(mesh.num_nodes()),
      num_columns_(mesh.num_columns),
      num_levels_(mesh.num_levels),
      points_per_face_((subdivision + 1) * (subdivision + 2) / 2),
      rest_(mesh.rest) {
  require(subdivision >= 1 && subdivision <= 64, "SubdividedSurface: subdivision must be 1..64");
  require(mesh.face_columns.size() == static_cast<size_t>(mesh.num_faces) * nodes_per_face_ &&
              mesh.rest.rows() == num_nodes_,
          "SubdividedSurface: incomplete mesh");
  const int n = subdivision;
  const auto local = [n](int i, int j) { return j * (n + 1) - j * (j - 1) / 2 + i; };

  const TriangleBasis basis(mesh.order);
  const size_t table = static_cast<size_t>(points_per_face_) * nodes_per_face_;
  values_.resize(table), d_du_.resize(table), d_dv_.resize(table);
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i + j <= n; ++i) {
      const size_t at = static_cast<size_t>(local(i, j)) * nodes_per_face_;
      basis.evaluate(double(i) / n, double(j) / n, &values_[at], &d_du_[at], &d_dv_[at]);
    }
  }

  const int level = side == SurfaceSide::outer ? mesh.num_levels - 1 : 0;
  for (const int column : mesh.face_columns) face_nodes_.push_back(mesh.node(column, level));

  std::map<PointKey, int> first_with;
  for (int face = 0; face < mesh.num_faces; ++face) {
    const int* corners = &mesh.face_columns[static_cast<size_t>(face) * nodes_per_face_];
    const int base = face * points_per_face_;
    for (int j = 0; j <= n; ++j) {
      for (int i = 0; i + j <= n; ++i) {
        const int vertex = static_cast<int>(vertices_.size());
        vertices_.push_back({face, double(i) / n, double(j) / n});
        welded_.push_back(first_with.try_emplace(point_key(corners, i, j, n, vertex), vertex).first->second);
      }
    }
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i + j < n; ++i) {
        triangles_.push_back({base + local(i, j), base + local(i + 1, j), base + local(i, j + 1)});
        if (i + j + 1 == n) continue;
        triangles_.push_back({base + local(i + 1, j), base + local(i + 1, j + 1), base + local(i, j + 1)});
      }
    }
  }
}

SubdividedSurface::Row SubdividedSurface::row(int vertex) const {
  require(vertex >= 0 && vertex < num_vertices(), "SubdividedSurface: vertex out of range");
  const size_t face = static_cast<size_t>(vertex / points_per_face_), point = vertex % points_per_face_;
  return {&face_nodes_[face * nodes_per_face_], &values_[point * nodes_per_face_], nodes_per_face_};
}

MatrixX3 SubdividedSurface::apply(const VectorXd& displacement, Derivative derivative) const {
  require(displacement.size() == 0 || displacement.size() == 3 * num_nodes_,
          "SubdividedSurface: displacement must have 3 entries per node");
  const auto& table = derivative == Derivative::none ? values_ : derivative == Derivative::u ? d_du_ : d_dv_;
  MatrixX3 out = MatrixX3::Zero(num_vertices(), 3);
  for (int vertex = 0; vertex < num_vertices(); ++vertex) {
    const int* nodes = &face_nodes_[static_cast<size_t>(vertex / points_per_face_) * nodes_per_face_];
    const double* weights = &table[static_cast<size_t>(vertex % points_per_face_) * nodes_per_face_];
    for (int k = 0; k < nodes_per_face_; ++k) {
      out.row(vertex) += weights[k] * rest_.row(nodes[k]);
      if (displacement.size() > 0) {
        out.row(vertex) += weights[k] * displacement.segment<3>(3 * nodes[k]).transpose();
      }
    }
  }
  return out;
}

MatrixX3 SubdividedSurface::positions(const VectorXd& displacement) const {
  return apply(displacement, Derivative::none);
}

MatrixX3 SubdividedSurface::normals(const VectorXd& displacement) const {
  const MatrixX3 x_u = apply(displacement, Derivative::u), x_v = apply(displacement, Derivative::v);
  MatrixX3 out(num_vertices(), 3);
  for (int i = 0; i < num_vertices(); ++i) {
    out.row(i) = Vec3(x_u.row(i)).cross(Vec3(x_v.row(i))).normalized().transpose();
  }
  return out;
}

MatrixX3 SubdividedSurface::smooth_normals(const VectorXd& displacement) const {
  const MatrixX3 exact = normals(displacement);
  MatrixX3 sum = MatrixX3::Zero(num_vertices(), 3), out(num_vertices(), 3);
  for (int i = 0; i < num_vertices(); ++i) sum.row(welded_[i]) += exact.row(i);
  for (int i = 0; i < num_vertices(); ++i) out.row(i) = sum.row(welded_[i]).normalized();
  return out;
}

VectorXd SubdividedSurface::interpolate(const VectorXd& values) const {
  const bool per_node = values.size() == num_nodes_;
  require(per_node || values.size() == num_columns_,
          "SubdividedSurface: a scalar needs one value per node or per column");
  VectorXd out(num_vertices());
  for (int i = 0; i < num_vertices(); ++i) {
    const Row r = row(i);
    double sum = 0;
    for (int k = 0; k < r.size; ++k)
      sum += r.weights[k] * values[per_node ? r.nodes[k] : r.nodes[k] / num_levels_];
    out[i] = sum;
  }
  return out;
}

VectorXd SubdividedSurface::normal_displacement(const VectorXd& displacement) const {
  const MatrixX3 moved = positions(displacement) - positions({});
  return moved.cwiseProduct(normals({})).rowwise().sum();
}

}  // namespace rhytid
