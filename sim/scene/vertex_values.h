// Numbers per vertex of the input surface, from a file that a scene mentions: layer thickness, ligament
// exponent.
//
//   CSV    a header line, then rows  vertex,value  in any order; # begins a comment line
//   JSON   a list by vertex number from 0 (null = none), or an object {"12": 1.5, ...}
#pragma once

#include <string>
#include <vector>

#include "sim/core/types.h"
#include "sim/mesh/skin_mesh.h"

namespace rhytid {

/// Values by vertex, NaN where the file gives none; all given ones are > 0. `mentioned_at` names the scene's
/// key in messages. Throws InputError naming file and line or vertex.
std::vector<double> read_vertex_values(const std::string& path, const std::string& mentioned_at);

/// Mean of the values that are not NaN.
double mean_of_given(const std::vector<double>& values);

/// Values at the vertices of a (cropped) surface from values by vertex of the file it came from; of vertices
/// that were joined any may have the value. Throws InputError naming `where` and the first vertex without a
/// value, or two joined ones whose values differ.
VectorXd on_surface_vertices(const TriangleSurface& surface, const std::vector<double>& by_file_vertex,
                             const std::string& where);

}  // namespace rhytid
