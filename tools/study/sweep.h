// A sweep: every variant of an experiment is run and measured, each in a folder of its own, and tables and a
// page are made of what was found. What is finished is kept as long as all that it depends on is the same:
// settings, measure, the contents of files, the program. A sweep that was stopped goes on where it was.
// Tests: tests/tools/study_test.cpp
#pragma once

#include <string>
#include <vector>

#include "tools/frame_writer.h"
#include "tools/study/experiment.h"
#include "tools/study/study_run.h"
#include "tools/verb.h"

namespace rhytid::tools {

struct SweepOptions {
  std::vector<std::string> only;  ///< names of variants; empty = all
  bool anew = false;              ///< runs them from the beginning, whatever is there
  FrameOptions frames = {};
  Shard shard = {};  ///< of the variants
};

/// Builds the models of all variants asked for, then runs what is not finished and writes results.csv,
/// results.md and index.html into context.options.output, with context.options.settings applied last to every
/// variant. Results of other settings, files or programs are left out, and said to be. Exit code: that of the
/// worst variant; interrupted when stopped. A shard writes no tables. Throws InputError before anything is written when a variant
/// cannot be built or measured.
ExitCode run_sweep(VerbContext& context, const Experiment& experiment, const SweepOptions& options);

}  // namespace rhytid::tools
