// The skin of a scene: its prism mesh and its layers' elasticity and viscosity.
//
// Native blocks: per layer "layer/<name>": μ∞, C, K, μ_m, τ (SkinTheta); with a pre-stretch "pre_stretch":
// λ₁, λ₂.
#pragma once

#include "sim/scene/parts/scene_part.h"

namespace rhytid {

/// The prism mesh of a scene: reads or makes the surface, crops, bends, extrudes. The thickness of a layer
/// with values per vertex becomes their mean over the patch. Throws InputError.
SkinMesh build_skin_mesh(Scene& scene);

class SkinPart final : public ScenePart {
 public:
  explicit SkinPart(const Scene& scene);
  void add_native_blocks(const Scene& scene, Model& model) const override;
  void add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const override;
  void set_native(const Scene& scene, const Model& model, VectorXd& native) const override;
  bool add_derivative(const Scene& scene, const Model& model, const std::string& address,
                      VectorXd& derivative) const override;

 private:
  std::vector<bool> built_relaxing_;  // per layer: its term has a Maxwell branch
};

}  // namespace rhytid
