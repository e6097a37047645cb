// What the draws of a repeated twin study say together. Tests: tests/tools/recovery_test.cpp
#pragma once

#include <string>
#include <vector>

#include "tools/bench/recovery_draw.h"

namespace rhytid::tools {

/// Of k successes in n trials, the 95 % interval of the share by Wilson's score; 0 to 1 without trials.
struct Share {
  double low = 0, high = 1;
};
Share share_interval(int k, int n);

/// The draws of one variant of one case that are there.
struct RecoveryGroup {
  std::string case_name, variant, description;
  std::vector<RecoveryDraw> draws;
};

/// One parameter over the draws of a group that were answered. Errors are in the coordinate of the fit.
struct RecoverySummary {
  std::string address, unit, transform;
  double truth = 0;
  int draws = 0;         ///< answered
  int undetermined = 0;  ///< of these, reported as not determined
  int inside = 0;        ///< of these, the 95 % interval holds the truth
  double bias = 0;       ///< mean error
  double spread = 0;     ///< standard deviation of the errors, n − 1; nan below two draws
  double rms = 0;        ///< root of the mean squared error
  double sigma = 0;      ///< mean of those reported; nan when none is
};
std::vector<RecoverySummary> summarise(const RecoveryGroup& group);

/// Writes into `folder`: recovery.csv (a row per draw and parameter), summary.csv, recovery.md, index.html, and
/// per case and parameter CASE_PARAMETER_draws.svg (the case as it is, draws by estimate) and
/// CASE_PARAMETER_variants.svg. Returns the Markdown.
std::string write_recovery_report(const std::string& folder, const std::vector<RecoveryGroup>& groups);

}  // namespace rhytid::tools
