// A collider's path from a CSV file.
#pragma once

#include <string>
#include <vector>

#include "sim/scene/scene.h"

namespace rhytid {

/// Reads knots from lines "time,x,y,z" or "time,x,y,z,qw,qx,qy,qz" (s, mm, unit quaternions) under a header
/// that names the columns in any order (also time_s, x_mm, y_mm, z_mm); blank lines and lines that begin with
/// # are skipped. Throws InputError naming the file and line: not readable, an unknown or missing column, a
/// cell that is no finite number, times that do not increase, a quaternion whose length is off 1 by more than
/// one per cent.
std::vector<PathKnot> read_path(const std::string& file);

}  // namespace rhytid
