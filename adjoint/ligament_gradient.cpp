#include "adjoint/ligament_gradient.h"

#include "sim/element/basis.h"

namespace rhytid::adjoint {

VectorXd ligament_gradient(const Model& model, const VectorXd& native_bar) {
  const NativeBlock& b = model.native_block("ligaments/b");
  return native_bar.segment(b.offset, b.size);
}

VectorXd ligament_gradient_by_vertex(const Model& model, const VectorXd& native_bar) {
  const VectorXd by_column = ligament_gradient(model, native_bar);
  const SkinMesh& mesh = model.mesh;
  const TriangleBasis basis(mesh.order);
  VectorXd by_vertex = VectorXd::Zero(mesh.surface.vertices.rows());
  // The transpose of interpolate_vertices: every column once, whichever of its faces comes first.
  std::vector<bool> is_done(static_cast<std::size_t>(mesh.num_columns), false);
  const double p = mesh.order;
  for (std::size_t face = 0; face < mesh.surface.faces.size(); ++face)
    for (int node = 0; node < basis.num_nodes(); ++node) {
      const int column = mesh.face_columns[face * static_cast<std::size_t>(basis.num_nodes()) +
                                           static_cast<std::size_t>(node)];
      if (is_done[static_cast<std::size_t>(column)]) continue;
      is_done[static_cast<std::size_t>(column)] = true;
      const auto& corners = mesh.surface.faces[face];
      const auto [i, j] = basis.lattice()[node];
      const double weights[] = {(p - i - j) / p, i / p, j / p};
      for (int k = 0; k < 3; ++k) by_vertex[corners[k]] += weights[k] * by_column[column];
    }
  return by_vertex;
}

}  // namespace rhytid::adjoint
