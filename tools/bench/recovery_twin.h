// The truth of a repeated twin study: simulated and drawn once, filmed with as many draws of noise as wanted.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fitting/cameras.h"
#include "fitting/case.h"
#include "sim/scene/scene_model.h"
#include "tools/progress.h"
#include "tools/render/skin_renderer.h"

namespace rhytid::tools {

struct RecoveryTwin {
  std::vector<PictureLevels> frames;  ///< before noise
  double rate = 0;                    ///< 1/s, of the footage
  fitting::Camera camera;             ///< as camera.yaml has it
  /// Writes footage with the noise of `noise` and the seed. Throws InputError.
  void film(const fitting::RenderCase& noise, unsigned seed, const std::string& path) const;
};

/// Simulates the truth of a case, or takes the motion that `folder` has of it, and draws its frames. Writes
/// truth_motion.bin, camera.yaml and truth.json into `folder`, as `rhytid render` does. Nothing when
/// interrupted. Throws InputError, also when the truth's run does not reach its end.
std::optional<RecoveryTwin> make_recovery_twin(const fitting::Case& c, const Scene& fit,
                                               const SceneModel& truth, const std::string& folder,
                                               Progress& progress);

}  // namespace rhytid::tools
