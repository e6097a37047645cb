// The clock of everything in a scene that moves by a path: it runs /time/offset ahead of the frames.
//
// Native block "time": offset, s. There is none in a scene where nothing moves.
#pragma once

#include "sim/scene/parts/scene_part.h"

namespace rhytid {

class ClockPart final : public ScenePart {
 public:
  void add_native_blocks(const Scene& scene, Model& model) const override;
  void add_terms(const Scene&, Model&, std::vector<FeatureNote>&) const override {}
  void set_native(const Scene& scene, const Model& model, VectorXd& native) const override;
  bool add_derivative(const Scene& scene, const Model& model, const std::string& address,
                      VectorXd& derivative) const override;
};

}  // namespace rhytid
