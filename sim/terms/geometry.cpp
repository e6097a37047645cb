#include "sim/terms/geometry.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "sim/core/error.h"

namespace rhytid {

namespace {

ProductTables product_tables(const TriangleBasis& triangle, const LineBasis& line, const MaterialSlab& slab,
                             const PrismRule& rule) {
  ProductTables t;
  t.plane_nodes = triangle.num_nodes();
  t.padded_plane_nodes = (t.plane_nodes + 7) / 8 * 8;
  t.line_nodes = line.num_nodes();
  t.line_points = rule.line_points;
  require(t.line_points <= kMaxLinePoints && t.line_nodes <= ProductView::kMaxLineNodes,
          "prism_group: too many points");
  const std::size_t padded = static_cast<std::size_t>(t.padded_plane_nodes),
                    plane_points = rule.points.size() / static_cast<std::size_t>(t.line_points);
  t.plane.resize(plane_points * 3 * padded);
  t.line.resize(static_cast<std::size_t>(t.line_points) * 2 * kLineStride);
  for (std::size_t k = 0; k < plane_points; ++k) {
    const PrismPoint& point = rule.points[k * static_cast<std::size_t>(t.line_points)];
    double* const row = t.plane.data() + k * 3 * padded;
    triangle.evaluate(point.u, point.v, row + 2 * padded, row, row + padded);
  }
  t.padded_plane_rows = (3 * static_cast<int>(plane_points) + 7) / 8 * 8;
  const std::size_t rows = static_cast<std::size_t>(t.padded_plane_rows);
  t.plane_by_node.resize(static_cast<std::size_t>(t.plane_nodes) * rows);
  for (std::size_t j = 0; j < static_cast<std::size_t>(t.plane_nodes); ++j)
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t k = 0; k < plane_points; ++k)
        t.plane_by_node[j * rows + r * plane_points + k] = t.plane[(3 * k + r) * padded + j];
  for (int z = 0; z < t.line_points; ++z) {
    const double w = slab.w_begin + 0.5 * (slab.w_end - slab.w_begin) * (rule.points[z].w + 1);
    double* const row = t.line.data() + static_cast<std::size_t>(z) * 2 * kLineStride;
    line.evaluate(w, row, row + kLineStride);
  }
  return t;
}

}  // namespace

TermGroup prism_group(const SkinMesh& mesh, int element_layer, const MaterialSlab& slab,
                      const TriangleRule& rule, int thickness_points) {
  return prism_group(mesh, element_layer, slab, tensor_rule(rule, thickness_points));
}

TermGroup prism_group(const SkinMesh& mesh, int element_layer, const MaterialSlab& slab,
                      const PrismRule& rule) {
  const TriangleBasis triangle(mesh.order);
  const ElementLayer& layer = mesh.element_layers[element_layer];
  const LineBasis line(layer.order);
  const int np = triangle.num_nodes(), nq = line.num_nodes(), n = np * nq;
  TermGroup g;
  g.num_elements = mesh.num_faces;
  g.num_nodes = n;
  g.num_points = static_cast<int>(rule.points.size());
  g.material = slab.material;
  g.node_by_row.resize(static_cast<std::size_t>(3) * g.num_points * n);
  std::vector<double> reference_weight(g.num_points);
  std::vector<double> p(np), pu(np), pv(np), t(nq), tw(nq);
  const double half = 0.5 * (slab.w_end - slab.w_begin);
  int q = 0;
  for (const PrismPoint& point : rule.points) {
    triangle.evaluate(point.u, point.v, p.data(), pu.data(), pv.data());
    line.evaluate(slab.w_begin + half * (point.w + 1), t.data(), tw.data());
    double* rows = g.node_by_row.data() + static_cast<std::size_t>(3) * q * n;
    for (int j = 0; j < np; ++j)
      for (int k = 0; k < nq; ++k) {
        rows[j * nq + k] = pu[j] * t[k];
        rows[n + j * nq + k] = pv[j] * t[k];
        rows[2 * n + j * nq + k] = p[j] * tw[k];
      }
    reference_weight[q++] = point.weight * half;
  }
  if (rule.line_points > 0) g.product = product_tables(triangle, line, slab, rule);
  g.inverse_jacobian.resize(static_cast<std::size_t>(g.num_elements) * g.num_points * 9);
  g.weight.resize(static_cast<std::size_t>(g.num_elements) * g.num_points);
  for (int face = 0; face < mesh.num_faces; ++face) {
    const std::vector<int> nodes = mesh.element_nodes(element_layer, face);
    g.nodes.insert(g.nodes.end(), nodes.begin(), nodes.end());
    for (int qi = 0; qi < g.num_points; ++qi) {
      Mat3 jacobian = Mat3::Zero();  // ∂X/∂ξ
      for (int r = 0; r < 3; ++r) {
        const double* row = g.node_by_row.data() + (static_cast<std::size_t>(3) * qi + r) * n;
        for (int i = 0; i < n; ++i) jacobian.col(r) += row[i] * mesh.rest.row(nodes[i]).transpose();
      }
      const double det = jacobian.determinant();
      if (!(det > 0))
        throw InputError("mesh " + mesh.surface.origin + ": face " + std::to_string(face),
                         "an inverted element", "a positive volume; thin the layers or smooth the surface");
      const Mat3 inverse = jacobian.inverse();
      const std::size_t at = static_cast<std::size_t>(face) * g.num_points + qi;
      for (int r = 0; r < 3; ++r)
        for (int i = 0; i < 3; ++i) g.inverse_jacobian[at * 9 + 3 * r + i] = inverse(r, i);
      g.weight[at] = det * reference_weight[qi];
    }
  }
  return g;
}

TermGroup surface_group(const SkinMesh& mesh, SkinSide side, const TriangleRule& rule) {
  const TriangleBasis triangle(mesh.order);
  const int n = triangle.num_nodes(), p = mesh.order;
  TermGroup g;
  g.num_elements = mesh.num_faces;
  g.num_nodes = n;
  g.num_points = static_cast<int>(rule.points.size());
  g.node_by_row.resize(static_cast<std::size_t>(g.num_points) * n);
  std::vector<double> pu(static_cast<std::size_t>(g.num_points) * n), pv(pu.size());
  // Linear interpolation on the P1 refinement: local node triple and weights per point.
  std::vector<std::array<int, 3>> local_columns(g.num_points);
  std::vector<std::array<double, 3>> local_weights(g.num_points);
  const auto local_node = [&](int i, int j) {
    const auto& lattice = triangle.lattice();
    return static_cast<int>(std::find(lattice.begin(), lattice.end(), std::array<int, 2>{i, j}) -
                            lattice.begin());
  };
  for (int q = 0; q < g.num_points; ++q) {
    const TrianglePoint& point = rule.points[q];
    const std::size_t row = static_cast<std::size_t>(q) * n;
    triangle.evaluate(point.u, point.v, g.node_by_row.data() + row, pu.data() + row, pv.data() + row);
    const double a = point.u * p, b = point.v * p;
    const int i = std::min(static_cast<int>(a), p - 1), j = std::min(static_cast<int>(b), p - 1 - i);
    const double fu = a - i, fv = b - j;
    if (fu + fv <= 1 || i + j + 2 > p) {
      local_columns[q] = {local_node(i, j), local_node(i + 1, j), local_node(i, j + 1)};
      local_weights[q] = {1 - fu - fv, fu, fv};
    } else {
      local_columns[q] = {local_node(i + 1, j + 1), local_node(i, j + 1), local_node(i + 1, j)};
      local_weights[q] = {fu + fv - 1, 1 - fu, 1 - fv};
    }
  }
  const std::size_t points = static_cast<std::size_t>(g.num_elements) * g.num_points;
  g.weight.resize(points);
  g.rest.assign(points * 4, 0.0);
  g.field_columns.resize(points * 3);
  g.field_weights.resize(points * 3);
  for (int face = 0; face < mesh.num_faces; ++face) {
    const std::vector<int> nodes = side == SkinSide::inner ? mesh.inner_nodes(face) : mesh.outer_nodes(face);
    g.nodes.insert(g.nodes.end(), nodes.begin(), nodes.end());
    for (int q = 0; q < g.num_points; ++q) {
      Vec3 x = Vec3::Zero(), xu = Vec3::Zero(), xv = Vec3::Zero();
      for (int i = 0; i < n; ++i) {
        const std::size_t at = static_cast<std::size_t>(q) * n + i;
        const Vec3 node = mesh.rest.row(nodes[i]).transpose();
        x += g.node_by_row[at] * node;
        xu += pu[at] * node;
        xv += pv[at] * node;
      }
      const std::size_t at = static_cast<std::size_t>(face) * g.num_points + q;
      g.weight[at] = xu.cross(xv).norm() * rule.points[q].weight;
      for (int k = 0; k < 3; ++k) {
        g.rest[4 * at + k] = x[k];
        g.field_columns[3 * at + k] =
            mesh.face_columns[static_cast<std::size_t>(face) * n + local_columns[q][k]];
        g.field_weights[3 * at + k] = local_weights[q][k];
      }
    }
  }
  return g;
}

}  // namespace rhytid
