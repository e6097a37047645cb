// The run behind rendered footage: the truth's scene, simulated, as a moving outer surface at the footage's
// frame times.
#pragma once

#include "fitting/case.h"
#include "sim/scene/scene_model.h"
#include "tools/progress.h"
#include "tools/render/moving_surface.h"

namespace rhytid::tools {

/// The truth of a case: its scene, or the fit's when the case names none.
Scene truth_scene(const fitting::Case& c);

/// Frames of the truth's run per frame of footage: truth rate / fit rate. Throws InputError unless that is an
/// integer.
int frame_stride(const Scene& fit, const Scene& truth);

/// What names a motion in truth_motion.bin: the scene and the contents of the files behind it.
std::string motion_identity(const SceneModel& truth);

struct TwinRun {
  MovingSurface surface;  ///< frames 0, stride, 2·stride, ... as far as they were reached
  bool complete = false;  ///< every frame was reached
  std::string failure;    ///< one sentence when not complete
  double seconds = 0;
};

/// Simulates. The progress line shows frames and Newton iterations; an interrupt stops the run.
TwinRun run_twin(const SceneModel& truth, int stride, Progress& progress);

/// The complete motion in the file at `path` when it is of this very scene, else that of run_twin.
TwinRun kept_twin(const SceneModel& truth, int stride, const std::string& path, Progress& progress);

}  // namespace rhytid::tools
