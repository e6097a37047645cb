// The colliders of a scene: rigid shapes on paths that touch the outer surface, with or without friction.
//
// Native block per collider "collider/<name>": κ, inflation, μ, then its path knots [3] each, then, when it
// turns, the knots' quaternions [4] each, then the semi-axes [3] of an ellipsoid.
#pragma once

#include "sim/scene/parts/scene_part.h"

namespace rhytid {

class ColliderPart final : public ScenePart {
 public:
  /// Keeps the radii that the shapes are built with: a fitted radius is an inflation of its shape.
  explicit ColliderPart(const Scene& scene);

  void add_native_blocks(const Scene& scene, Model& model) const override;
  void add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const override;
  void set_native(const Scene& scene, const Model& model, VectorXd& native) const override;
  bool add_derivative(const Scene& scene, const Model& model, const std::string& address,
                      VectorXd& derivative) const override;

 private:
  std::vector<double> built_radii_;  // mm, 0 for shapes without one
  std::vector<bool> built_friction_;
};

}  // namespace rhytid
