// Points with normals from a file: bone as a scanner or another program gives it.
//
//   .ply        ASCII or binary, element vertex with x y z nx ny nz (any scalar type; other properties and
//               elements are passed over)
//   .obj        v and vn: as many normals as points (the i-th belongs to the i-th), or faces v//vn, v/vt/vn
//               that say which; a point with several takes their sum
//   .xyz .txt   six numbers per line, x y z nx ny nz, apart by blanks or commas; # begins a comment
#pragma once

#include <string>

#include "sim/core/types.h"

namespace rhytid {

struct PointCloud {
  MatrixX3 points;   ///< [n][3] mm
  MatrixX3 normals;  ///< [n][3] unit, out of the body
};

/// Reads a cloud; the ending of the name says the format. `mm_per_unit` scales to mm. Throws InputError
/// naming the file and, where there is one, the line or the point: what cannot be read, a number that is not
/// finite, a missing or zero normal, fewer than two distinct points.
PointCloud read_point_cloud(const std::string& path, double mm_per_unit);

}  // namespace rhytid
