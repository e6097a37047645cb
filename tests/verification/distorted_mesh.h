// Patches of every order, scheme and shape whose nodes stand where no symmetry helps: for tests of what holds
// on any mesh.
#pragma once

#include <algorithm>
#include <random>
#include <string>

#include "sim/element/quadrature.h"
#include "sim/mesh/skin_mesh.h"
#include "sim/terms/geometry.h"
#include "sim/terms/skin_law.h"

namespace rhytid::test {

/// Two material layers of one material, 2 × 2 cells; fibres stay straight, so that the default rules
/// integrate the patch test exactly also on curved elements.
inline SkinMesh distorted_mesh(int p, int q, bool composite, bool bent) {
  ExtrusionOptions o;
  o.order = p;
  o.layers = {{0.5, 1, q}, {0.3, 1, q}};
  o.composite = composite;
  o.composite_order = q;
  if (bent) o.bend_radius = 3;
  SkinMesh mesh = extrude(grid_surface(2, 2, 2, 2, GridPattern::union_jack), o);
  std::mt19937 rng(static_cast<unsigned>(10 * p + q));
  std::uniform_real_distribution<double> d(-0.1 / (p * p), 0.1 / (p * p));
  for (int c = 0; c < mesh.num_columns; ++c) {
    const int bottom = mesh.node(c, 0), top = mesh.node(c, mesh.num_levels - 1);
    const Vec3 low = mesh.rest.row(bottom), high = mesh.rest.row(top);
    Vec3 new_low = low, new_high = high;
    for (int a = 0; a < 3; ++a) new_low[a] += d(rng), new_high[a] += d(rng);
    for (int l = 0; l < mesh.num_levels; ++l) {
      const Vec3 x = mesh.rest.row(mesh.node(c, l));
      const double s = (x - low).norm() / (high - low).norm();
      mesh.rest.row(mesh.node(c, l)) = (1 - s) * new_low + s * new_high;
    }
  }
  return mesh;
}

/// Skin of one material; its parameters are native[0..].
template <class Law>
Term skin_term(const SkinMesh& mesh, const std::string& name, const KernelTable& kernels, const Law& law) {
  Term term(name, kernels, law);
  for (int layer = 0; layer < static_cast<int>(mesh.element_layers.size()); ++layer)
    for (const MaterialSlab& slab : mesh.element_layers[layer].slabs) {
      TermGroup g = prism_group(mesh, layer, slab, triangle_rule(std::min(12, 2 * mesh.order + 2)),
                                mesh.element_layers[layer].order + 1);
      for (int s = 0; s < Law::ntheta; ++s) g.theta.push_back({ThetaSlot::Kind::constant, s, {}});
      term.add_group(std::move(g));
    }
  return term;
}
inline Term skin_term(const SkinMesh& mesh) {
  return skin_term(mesh, "skin", skin_kernels(), SkinLaw{DamperScheme::exponential});
}

inline const VectorXd kNative = (VectorXd(5) << 0.2, 1.1, 6, 0.8, 0.07).finished();
inline const StepInfo kStep{0, 0, 1. / 24};

}  // namespace rhytid::test
