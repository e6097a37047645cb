// The run that a verb takes derivatives of.
#pragma once

#include <optional>

#include "sim/scene/scene_model.h"
#include "tools/exit_code.h"
#include "tools/progress.h"

namespace rhytid::tools {

/// A run that can be differentiated (tight tolerance and a polish, states kept), with progress. Nothing when
/// it was interrupted or did not reach its last frame; `code` then says which, and the reason is on stderr.
std::optional<Trajectory> polished_run(const SceneModel& scene_model, Progress& progress, ExitCode& code);

}  // namespace rhytid::tools
