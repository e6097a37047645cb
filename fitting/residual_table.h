// residuals.csv: every observation against the fitted prediction.
// Tests: tests/fitting/fit_result_test.cpp, tests/fitting/joint_test.cpp
#pragma once

#include <string>
#include <vector>

#include "fitting/fit_result.h"

namespace rhytid::fitting {

/// Header and rows of result.residuals; with columns for clip and camera where result.clips is not empty.
std::string residual_text(const FitResult& result);

/// Reads them back; `result` says which clips and cameras there are. Throws InputError naming `path`, line
/// and what is wrong.
std::vector<FitResidual> parse_residuals(const std::string& text, const std::string& path,
                                         const FitResult& result);

}  // namespace rhytid::fitting
