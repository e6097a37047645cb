// From a case to what a fit takes: clips with their scenes, cameras, tracks (made first where they are not
// there) and truth. Used by the verb fit. Tests: tests/tools/fitting_verbs.sh, tests/tools/joint_fit.sh
#pragma once

#include <optional>
#include <string>

#include "fitting/case.h"
#include "fitting/fit.h"
#include "tools/exit_code.h"
#include "tools/verb.h"

namespace rhytid::tools {

/// How a record names a file, so that it is found again from any working directory: relative to the folder of
/// results when it lies in there (the folder may move), else absolute.
std::string recorded(const std::string& path, const std::string& folder);

/// Tracks footage where a case has no tracks yet or others than it asks for; `tracked` is other than ok when
/// that was interrupted, and there is no input then. Throws InputError, naming the clip where there are
/// several.
std::optional<fitting::JointFitInput> fit_input(const fitting::Case& c, const fitting::FitCase& options,
                                                const std::string& folder, VerbContext& context,
                                                ExitCode& tracked);

/// Names of case, scenes, footage, tracks and cameras in the result.
void record_files(const fitting::Case& c, const std::string& folder, fitting::FitResult& result);

}  // namespace rhytid::tools
