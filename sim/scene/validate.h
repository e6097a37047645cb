// Checking a scene's JSON against the rules and against itself.
#pragma once

#include <string>

#include "sim/scene/located_json.h"
#include "sim/scene/rules.h"

namespace rhytid {

/// The complete scene (or what `rules` describes): every default filled in, every quantity a number in
/// internal units (mm, N, MPa, s), but for RuleType::quantity, which stays as written.
/// Throws InputError "file:line: /pointer: got ..., expected ..." for unknown keys (naming the nearest valid
/// one), wrong types and dimensions, values out of range, missing keys and keys that exclude each other.
LocatedJson resolve_against_rules(const LocatedJson& scene, const RuleNode& rules = scene_rule_tree());

/// What no single rule can say: names unique, knot times increasing, normals not zero, a sphere has a radius.
/// Takes the result of resolve_against_rules. Throws InputError.
void check_consistency(const LocatedJson& scene);

}  // namespace rhytid
