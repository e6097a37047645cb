// What the rim of a scene's skin may do: the constraints of the model.
#pragma once

#include <numbers>

#include "sim/mesh/skin_mesh.h"
#include "sim/scene/scene.h"
#include "sim/time/model.h"

namespace rhytid {

/// A sliding rim that turns by more than this has a corner there. Between the turns of the regular decagon
/// and 11-gon: polygons with fewer sides have corners, finer ones are round rims.
inline constexpr double kCornerTurn = 35 * std::numbers::pi / 180;  // rad

/// Blocks of unknowns and what is held. On the rim: `clamped` nothing moves; `sliding` the wall of the rim
/// stays in its plane (outward conormal held), and a corner stays in both of its walls (both in-plane
/// directions held, only the thickness direction is free); `free` nothing is held. Columns of the parts in
/// skin.held are fixed, or moved along the part's path. Throws InputError naming `file` for a part without
/// nodes, two parts that share some, or when no node is free.
Constraints skin_constraints(const SkinMesh& mesh, const SkinScene& skin, const std::string& file);

/// Rim columns that are corners, ascending.
std::vector<int> rim_corners(const SkinMesh& mesh);

}  // namespace rhytid
