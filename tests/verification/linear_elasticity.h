// Small displacements of a mesh of any shape: the stiffness of the skin term at rest, boundary conditions by
// component, one factorisation. For the problems of structural mechanics that scenes cannot describe.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "sim/solve/block_matrix.h"
#include "sim/terms/geometry.h"
#include "sim/terms/skin_law.h"

namespace rhytid::test {

/// Unit square × thickness: one layer of order q, cells nx × ny, its nodes moved to place(s, t, w) with s, t
/// in 0..1 and w in −1/2..1/2 of the thickness. Rest positions are exact at every node: truly curved
/// elements.
inline SkinMesh mapped_mesh(int p, int q, int nx, int ny, GridPattern pattern,
                            const std::function<Vec3(double, double, double)>& place) {
  ExtrusionOptions o;
  o.order = p;
  o.layers = {{1, 1, q}};
  SkinMesh mesh = extrude(grid_surface(10, 10, nx, ny, pattern), o);
  for (int i = 0; i < mesh.num_nodes(); ++i) {
    const Vec3 x = mesh.rest.row(i).transpose();
    mesh.rest.row(i) = place(x[0] / 10 + 0.5, x[1] / 10 + 0.5, x[2] + 0.5).transpose();
  }
  return mesh;
}

class LinearElasticity {
 public:
  LinearElasticity(const SkinMesh& mesh, double youngs_modulus, double poissons_ratio)
      : mesh_(&mesh), pattern_(mesh.num_nodes(), cliques(mesh)), matrix_(pattern_), factor_(pattern_) {
    load = VectorXd::Zero(3 * mesh.num_nodes());
    const double mu = youngs_modulus / (2 * (1 + poissons_ratio)),
                 bulk = youngs_modulus / (3 * (1 - 2 * poissons_ratio));
    const VectorXd native = Vec3(mu, 1, bulk);
    Term term("skin", elastic_skin_kernels(), ElasticSkinLaw{});
    TermGroup g =
        prism_group(mesh, 0, mesh.element_layers[0].slabs.front(),
                    triangle_rule(std::min(12, 2 * mesh.order + 2)), mesh.element_layers[0].order + 1);
    for (int s = 0; s < 3; ++s) g.theta.push_back({ThetaSlot::Kind::constant, s, {}});
    term.add_group(std::move(g));
    TermStepData data;
    const StepInfo step{0, 0, 1};
    const VectorXd rest = VectorXd::Zero(load.size());
    term.prepare(step, native, rest, nullptr, data);
    Sink sink{&matrix_};
    term.hessian(step, data, rest, false, sink);
  }

  VectorXd load;  ///< [num_nodes·3]

  void hold(int node, int axis) { held_.push_back(3 * node + axis); }
  VectorXd solve() {
    for (const int i : held_) {
      matrix_.fix(i);
      load[i] = 0;
    }
    EXPECT_TRUE(factor_.factorize(matrix_)) << "a mechanism";
    return factor_.solve(matrix_, load);
  }
  /// Uniform tractions of total `force` on the face of the given columns, which are in order along the edge
  /// and evenly spaced in each of its cells (natural length weights: for straight edges of even cells).
  void load_face(const std::vector<int>& columns, const Vec3& force) {
    const int p = mesh_->order, cells = (static_cast<int>(columns.size()) - 1) / p;
    const std::vector<double> along = newton_cotes(p), across = newton_cotes(mesh_->num_levels - 1);
    for (int cell = 0; cell < cells; ++cell)
      for (int i = 0; i <= p; ++i)
        for (int level = 0; level < mesh_->num_levels; ++level)
          load.segment<3>(3 * mesh_->node(columns[static_cast<std::size_t>(cell * p + i)], level)) +=
              force * along[static_cast<std::size_t>(i)] * across[static_cast<std::size_t>(level)] / cells;
  }
  /// The columns with the given first or second coordinate in the unit square, in order of the other.
  static std::vector<int> edge(const SkinMesh& natural, int axis, double at) {
    std::vector<int> list;
    const auto x = [&](int c, int a) { return natural.rest(natural.node(c, 0), a); };
    for (int c = 0; c < natural.num_columns; ++c)
      if (std::fabs(x(c, axis) - at) < 1e-9) list.push_back(c);
    std::sort(list.begin(), list.end(), [&](int a, int b) { return x(a, 1 - axis) < x(b, 1 - axis); });
    return list;
  }

 private:
  struct Sink final : Term::MatrixSink {
    explicit Sink(BlockMatrix* m) : matrix(m) {}
    void add(const TermGroup&, int element, double* dense) override { matrix->add(element, dense); }
    BlockMatrix* matrix;
  };
  static std::vector<std::vector<int>> cliques(const SkinMesh& mesh) {
    std::vector<std::vector<int>> list;
    for (int face = 0; face < mesh.num_faces; ++face) list.push_back(mesh.element_nodes(0, face));
    return list;
  }
  /// ∫ of Lagrange's polynomials on n + 1 even points of [0, 1].
  static std::vector<double> newton_cotes(int n) {
    switch (n) {
      case 1:
        return {1. / 2, 1. / 2};
      case 2:
        return {1. / 6, 4. / 6, 1. / 6};
      case 3:
        return {1. / 8, 3. / 8, 3. / 8, 1. / 8};
      default:
        return {7. / 90, 32. / 90, 12. / 90, 32. / 90, 7. / 90};
    }
  }

  const SkinMesh* mesh_;
  BlockPattern pattern_;
  BlockMatrix matrix_;
  CholeskyFactor factor_;
  std::vector<int> held_;
};

}  // namespace rhytid::test
