// From what a scene says about its surface to the triangles that are extruded.
#pragma once

#include "sim/mesh/triangle_surface.h"
#include "sim/scene/scene.h"

namespace rhytid {

/// Reads the mesh file, joins or refuses coincident vertices and crops, or makes the grid. Throws InputError
/// (files, crops that keep nothing, a doubtful unit); what extrude() refuses is left to it.
TriangleSurface scene_surface(const SurfaceScene& surface);

/// Vertex indices from a text file: integers from 0 separated by white space or commas, # begins a comment.
/// Throws InputError naming the line.
std::vector<int> read_vertex_list(const std::string& path);

}  // namespace rhytid
