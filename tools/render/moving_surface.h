// The outer skin of a finished run and how it moved: all that rendering and exact ground truth need, without
// the model that made it. Kept beside the footage as truth_motion.bin.
#pragma once

#include <string>
#include <vector>

#include "sim/mesh/skin_mesh.h"
#include "sim/output/surface_tessellation.h"

namespace rhytid::tools {

/// A material point of the outer surface.
struct MaterialPoint {
  int face = -1;
  double u = 0, v = 0;  ///< natural coordinates in the face
};

struct MovingSurface {
  SkinMesh mesh;                        ///< outer columns alone: one level, no elements
  std::vector<double> times;            ///< [frames] s
  std::vector<VectorXd> displacements;  ///< [frames][num_columns · 3] mm
  std::string scene;                    ///< text that names what made it

  int frames() const { return static_cast<int>(times.size()); }
  /// Position x(u, v) on the curved face at the end of a frame, mm; with the tangents ∂x/∂u, ∂x/∂v if asked.
  Vec3 position(const MaterialPoint& point, int frame, Vec3* x_u = nullptr, Vec3* x_v = nullptr) const;
  /// Rest position, mm.
  Vec3 rest(const MaterialPoint& point) const;
  /// Unit mean of the rest normals, by area.
  Vec3 mean_normal() const;
};

/// The outer surface of a skin, without frames.
MovingSurface outer_surface(const SkinMesh& skin, const std::string& scene);
/// The outer columns' part of a displacement [num_nodes · 3] of the whole skin. [num_columns · 3]
VectorXd outer_displacement(const SkinMesh& skin, const VectorXd& u);

/// One line of JSON that says the sizes, then doubles in this machine's byte order. Throws InputError.
void write_motion(const MovingSurface& surface, const std::string& path);
MovingSurface read_motion(const std::string& path);

}  // namespace rhytid::tools
