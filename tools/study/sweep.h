// A sweep: every variant of an experiment is run and measured, each in a folder of its own, and tables and a
// page are made of what was found. What is finished is kept; a sweep that was stopped goes on where it was.
#pragma once

#include <string>
#include <vector>

#include "tools/frame_writer.h"
#include "tools/study/experiment.h"
#include "tools/verb.h"

namespace rhytid::tools {

struct SweepOptions {
  std::vector<std::string> only;  ///< names of variants; empty = all
  FrameOptions frames;
};

/// Runs what is not finished and writes results.csv, results.md and index.html into `folder`. Exit code: that
/// of the worst variant; interrupted when stopped.
ExitCode run_sweep(VerbContext& context, const Experiment& experiment, const std::string& folder,
                   const SweepOptions& options);

}  // namespace rhytid::tools
