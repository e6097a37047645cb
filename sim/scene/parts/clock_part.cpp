#include "sim/scene/parts/clock_part.h"

#include "sim/scene/collider_motion.h"

namespace rhytid {

void ClockPart::add_native_blocks(const Scene& scene, Model& model) const {
  if (!has_motion(scene)) return;
  add_native_block(model, "time", 1, {});
  model.clock = model.native_blocks.back().offset;
}

void ClockPart::set_native(const Scene& scene, const Model& model, VectorXd& native) const {
  if (model.clock >= 0) native[model.clock] = scene.time.offset;
}

bool ClockPart::add_derivative(const Scene&, const Model& model, const std::string& address,
                               VectorXd& derivative) const {
  if (address != "/time/offset" || model.clock < 0) return false;
  derivative[model.clock] = 1;
  return true;
}

}  // namespace rhytid
