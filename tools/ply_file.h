// Coloured triangle meshes as .ply, which mesh viewers open without a plug-in.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/output/image.h"

namespace rhytid::tools {

/// Writes binary little-endian PLY, atomically: x, y, z (mm, double), red, green, blue, and one double
/// property `scalar_name` per vertex. Throws ContractError on sizes that do not fit, InputError naming the
/// path.
void write_ply(const std::string& path, const MatrixX3& vertices,
               const std::vector<std::array<int, 3>>& triangles, const std::vector<Rgb>& colours,
               const std::string& scalar_name, const VectorXd& scalar);

}  // namespace rhytid::tools
