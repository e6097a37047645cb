// Subdivided surfaces as files that every viewer shows smoothly: .vtp (with scalars) and .obj.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/output/vtu.h"

namespace rhytid {

/// Writes triangles with per-vertex fields as VTK PolyData, double precision. Throws ContractError on sizes
/// that do not fit and InputError naming the path.
void write_vtp(const std::string& path, const MatrixX3& vertices,
               const std::vector<std::array<int, 3>>& triangles,
               const std::vector<OutputField>& vertex_fields, double time = 0);

/// Writes triangles as Wavefront OBJ (vertex order kept, full precision); `normals` may be empty.
void write_obj(const std::string& path, const MatrixX3& vertices,
               const std::vector<std::array<int, 3>>& triangles, const MatrixX3& normals = {});

}  // namespace rhytid
