// The quadrature rule of the skin's elements, and whether it sees every way in which an element can deform.
//
// An element of orders p, q has 3·(p+1)(p+2)/2·(q+1) − 6 ways to deform; a rule sees 6 strains at each of its
// points. With fewer strains than ways some deformations cost nothing whatever the material.
// With enough of them a rule may still be too weak. Strains in the plane have degree p − 1 in the plane and q
// through the thickness, so that their energy has twice that; through the thickness one degree less, q Gauss
// points, is enough beyond q = 1 (a bar that is bent and twisted stores 0.1 % less). That, and degree 2p in the
// plane, is the default, which data/bench/pareto.md found better than the full rule of degree 2p + 2 and q + 1
// points, and no dearer: what it leaves out of an energy is less than what the polynomials add by locking. The
// publication's rules for sheets, linear or quadratic through the thickness, have that and little more.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/element/quadrature.h"
#include "sim/scene/scene.h"

namespace rhytid {

/// The rule in one slab of an element of thickness order `order`, with `fewer` Gauss points less through it
/// where it is a product of rules.
PrismRule skin_rule(const SkinScene& skin, int order, int fewer = 0);

/// One kind of element of a scene and what its rule makes of it.
struct SkinRuleCheck {
  std::string layer;             ///< its name, "" for the one element of the composite scheme
  int order = 1;                 ///< q
  int points = 0;                ///< of the whole element, all its slabs
  int ways = 0;                  ///< to deform: 3 · nodes − 6
  int plane = 0, thickness = 0;  ///< degrees that the rule is exact to
  bool sees_too_little() const { return 6 * points < ways; }
  /// What is needed not to be weak.
  int plane_needed = 0, thickness_needed = 0;
  bool is_weak() const { return plane < plane_needed || thickness < thickness_needed; }
};
/// Per layer of elements of a scene; one with the composite scheme.
std::vector<SkinRuleCheck> check_skin_rules(const SkinScene& skin);

}  // namespace rhytid
