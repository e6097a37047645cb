// What the mesh tests share: the text of an InputError, and volumes by integration over the elements.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "sim/core/error.h"
#include "sim/element/quadrature.h"
#include "sim/mesh/skin_mesh.h"

namespace rhytid::testing_support {

/// The line of the InputError that `action` throws; fails the test when there is none or more than one line.
template <typename Action>
std::string input_error(Action&& action) {
  try {
    action();
  } catch (const InputError& error) {
    const std::string line = error.what();
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    return line;
  }
  ADD_FAILURE() << "no InputError was thrown";
  return "";
}

struct VolumeReport {
  std::vector<double> per_material;  ///< mm³
  double total = 0;
  double smallest_determinant = 1e300;  ///< of ∂X/∂(u,v,w) over all quadrature points
};

/// Integrates det ∂X/∂(u,v,w) over the slabs of every element.
inline VolumeReport integrate_volume(const SkinMesh& mesh, int num_materials) {
  VolumeReport report;
  report.per_material.assign(num_materials, 0);
  const TriangleBasis triangle(mesh.order);
  const int n = triangle.num_nodes();
  std::vector<double> t(n), t_u(n), t_v(n);
  for (int layer = 0; layer < static_cast<int>(mesh.element_layers.size()); ++layer) {
    const LineBasis line(mesh.element_layers[layer].order);
    const int levels = line.num_nodes();
    std::vector<double> l(levels), l_w(levels);
    for (int face = 0; face < mesh.num_faces; ++face) {
      const std::vector<int> nodes = mesh.element_nodes(layer, face);
      for (const MaterialSlab& slab : mesh.element_layers[layer].slabs) {
        for (const auto& [u, v, triangle_weight] : triangle_rule(12).points) {
          triangle.evaluate(u, v, t.data(), t_u.data(), t_v.data());
          for (const auto& [s, line_weight] : gauss_legendre(5)) {
            const double half = (slab.w_end - slab.w_begin) / 2;
            line.evaluate(slab.w_begin + half * (1 + s), l.data(), l_w.data());
            Mat3 jacobian = Mat3::Zero();
            for (int j = 0; j < n; ++j) {
              for (int k = 0; k < levels; ++k) {
                const Vec3 x = mesh.rest.row(nodes[j * levels + k]);
                jacobian.col(0) += t_u[j] * l[k] * x;
                jacobian.col(1) += t_v[j] * l[k] * x;
                jacobian.col(2) += t[j] * l_w[k] * x;
              }
            }
            const double determinant = jacobian.determinant();
            report.smallest_determinant = std::min(report.smallest_determinant, determinant);
            report.per_material[slab.material] += triangle_weight * line_weight * half * determinant;
          }
        }
      }
    }
  }
  for (const double volume : report.per_material) report.total += volume;
  return report;
}

}  // namespace rhytid::testing_support
