// Screening: which parameters matter over their whole range. Runs of a scene at the points of a Morris or
// Sobol design, each kept by what it depends on, and the effects on a few outputs.
// Tests: tests/tools/screen_test.cpp
#pragma once

#include <string>
#include <vector>

#include "tools/study/parameter_range.h"
#include "tools/study/screening.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {

struct ScreenOptions {
  StudySize size = StudySize::quick;
  std::string variant;                 ///< of an experiment; empty = the first
  std::vector<std::string> addresses;  ///< empty = all of the scene
  std::string ranges;                  ///< file of ranges; empty = by the factor
  double factor = 2;
  int trajectories = 10, levels = 4;  ///< Morris
  int sobol_samples = 0;              ///< > 0: Sobol indices instead
  unsigned seed = 1;
  Shard shard;
  bool anew = false;
};

/// What is measured of a run, at its last frame: force_NAME of every collider [N], rms_displacement
/// (over the outer surface by area) and max_displacement [mm], amplitudes of wrinkles where an experiment says.
struct ScreenResult {
  std::vector<ParameterRange> ranges;
  MatrixXd points;                         ///< [runs of the design][parameters], in [0, 1]
  std::vector<ResultColumn> outputs;       ///< names and units
  MatrixXd values;                         ///< [runs of the design][outputs]; NaN = missing
  std::vector<std::string> status;         ///< per run of the design: complete, not_converged or missing
  int runs = 0, finished = 0, failed = 0;  ///< different points; failed ones count as finished
  bool is_sobol = false;                   ///< else Morris, also while no run is there
  std::vector<std::vector<MorrisEffect>> morris;  ///< [outputs][parameters], or empty
  std::vector<std::vector<SobolIndex>> sobol;     ///< likewise
};

/// Runs what is missing of the shard and writes what is known; a shard writes no tables. Throws InputError.
ExitCode run_screen(VerbContext& context, const ScreenOptions& options);

/// Table for the terminal.
std::string screen_text(const ScreenResult& r);

/// runs.csv, effects.csv or indices.csv, OUTPUT.svg and OUTPUT_ranking.svg, screen.txt, index.html.
void write_screen(const std::string& folder, const std::string& title, const ScreenResult& r);

}  // namespace rhytid::tools
