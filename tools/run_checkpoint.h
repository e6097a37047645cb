// state.bin: what a run needs to go on from the last completed frame.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "sim/time/model.h"

namespace rhytid::tools {

struct RunCheckpoint {
  std::string identity;         ///< of the scene and the program's number formats: see run_identity
  int frame = 0;                ///< frames completed
  State state;                  ///< at its end
  std::vector<double> carried;  ///< of StepTable
};

/// Text that is equal for runs whose states may be exchanged: the scene without name, output settings and
/// number of frames, and the numbers of the model that it and its files made.
std::string run_identity(const Scene& scene, const Model& model);

/// Atomic; doubles are kept bit by bit in this machine's byte order. Throws InputError naming the path.
void write_checkpoint(const std::string& path, const RunCheckpoint& checkpoint);

/// Nothing when there is no such file. Throws InputError when it is damaged or of another run.
std::optional<RunCheckpoint> read_checkpoint(const std::string& path, const std::string& identity);

}  // namespace rhytid::tools
