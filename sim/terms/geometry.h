// Quadrature points on the prism mesh: reference tables, Jacobians and weights of the element groups of a
// term.
#pragma once

#include "sim/element/quadrature.h"
#include "sim/mesh/skin_mesh.h"
#include "sim/terms/term.h"

namespace rhytid {

/// Points of one material slab in one element layer: the rule mapped to the slab. Everything but theta is
/// filled. Throws InputError when an element is inverted at a point (names the face).
TermGroup prism_group(const SkinMesh& mesh, int element_layer, const MaterialSlab& slab,
                      const PrismRule& rule);
/// The same with the product of a triangle rule and Gauss-Legendre of `thickness_points`.
TermGroup prism_group(const SkinMesh& mesh, int element_layer, const MaterialSlab& slab,
                      const TriangleRule& rule, int thickness_points);

enum class SkinSide { inner, outer };

/// Points of the inner or outer surface; rest = X [3] and a fourth number left 0 (rest gap), field weights on
/// columns by linear interpolation on the P1 refinement. theta and rest[3] are the caller's.
TermGroup surface_group(const SkinMesh& mesh, SkinSide side, const TriangleRule& rule);

}  // namespace rhytid
