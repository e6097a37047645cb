// The base of a scene (skull): a rigid shape that the inner surface must not enter.
//
// Native block "base": κ, inflation, centre [3].
#pragma once

#include <utility>

#include "sim/scene/parts/scene_part.h"

namespace rhytid {

/// scene.base must be there.
class BasePart final : public ScenePart {
 public:
  void add_native_blocks(const Scene& scene, Model& model) const override;
  void add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const override;
  void set_native(const Scene& scene, const Model& model, VectorXd& native) const override;
  bool add_derivative(const Scene& scene, const Model& model, const std::string& address,
                      VectorXd& derivative) const override;
};

/// Smallest and largest gap between the inner surface at rest and the base, mm, over the points of contact.
/// It is subtracted there, so that rest is an equilibrium. Throws ContractError for a model without a base.
std::pair<double, double> base_rest_gaps(const Model& model);

}  // namespace rhytid
