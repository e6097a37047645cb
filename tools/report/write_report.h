// report.html of a fit: one file that holds everything, for the end of `rhytid fit` and for `rhytid report`.
// Tests: tests/tools/report/report_test.cpp
#pragma once

#include <string>
#include <vector>

#include "tools/progress.h"

namespace rhytid::tools {

struct ReportOptions {
  /// Run the scene once more at the fitted values, for the picture of the simulated skin.
  bool run = true;
};

struct ReportOutcome {
  std::string path;                   ///< of report.html
  std::vector<std::string> left_out;  ///< sentences: what is missing in it and why
  bool interrupted = false;           ///< then the picture of the simulated skin is missing
};

/// Writes report.html into `folder` from the fit.json and residuals.csv there, atomically. Scene, camera and
/// footage that are no longer there are left out and named. Throws InputError without a fit in the folder.
ReportOutcome write_report(const std::string& folder, Progress& progress, const ReportOptions& options = {});

}  // namespace rhytid::tools
