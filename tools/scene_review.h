// What a built scene tells about itself before it runs: scales against the mesh, what holds the skin, what
// the colliders touch, what the ligament sources reach. Warnings, never errors.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/scene/scene_model.h"
#include "tools/model_size.h"

namespace rhytid::tools {

/// A stiff film on a soft layer wrinkles at a wavelength of its own.
struct WrinkleScale {
  std::string film, soft;      ///< names of the two layers
  double wavelength = 0;       ///< mm
  double critical_strain = 0;  ///< compressive, at onset
  double node_spacing = 0;     ///< mm, mean in-plane distance of neighbouring nodes
  double nodes_per_wavelength() const { return wavelength / node_spacing; }
};

/// Film on a half-space, plane strain, instantaneous moduli:
///   wavelength 2π h (Ē_f / 3Ē_s)^(1/3), onset strain ¼ (3Ē_s / Ē_f)^(2/3), Ē = E/(1−ν²).
/// Nothing unless the outermost layer is at least five times stiffer than the one under it.
/// Source   X. Chen, J. W. Hutchinson, J. Appl. Mech. 71 (2004) 597; valid for a soft layer deeper than about
/// half the wavelength.
std::optional<WrinkleScale> wrinkle_scale(const SceneModel& scene_model);

/// Nodes that a wrinkle needs to be resolved.
inline constexpr double wanted_nodes_per_wavelength = 10;

/// Sizes of the surface that is extruded, mm.
struct SurfaceEdgeLengths {
  double shortest = 0, median = 0, longest = 0;
  Vec3 box = Vec3::Zero();
};
SurfaceEdgeLengths surface_edge_lengths(const TriangleSurface& surface);

/// One sentence per doubt that only the built model can raise; scene_warnings covers the file itself.
std::vector<std::string> review_scene(const SceneModel& scene_model, const StepCost& cost);

/// Those of them about the ligament sources: moved far to the surface, reaching no node, nodes that none
/// reaches.
std::vector<std::string> review_ligaments(const SceneModel& scene_model);

}  // namespace rhytid::tools
