// What the rim of a scene's skin may do: the constraints of the model.
#pragma once

#include "sim/mesh/skin_mesh.h"
#include "sim/scene/scene.h"
#include "sim/time/model.h"

namespace rhytid {

/// Blocks of unknowns and what is held on the rim: `clamped` nothing moves, `sliding` the wall of the rim
/// stays in its plane (outward conormal held), `free` nothing is held.
Constraints rim_constraints(const SkinMesh& mesh, RimCondition rim);

}  // namespace rhytid
