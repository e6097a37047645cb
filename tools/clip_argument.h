// Which clip of a case a verb means that works on one at a time: `--clip NAME`, or NAME/CAMERA where several
// cameras saw it. Tests: tests/tools/joint_fit.sh
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "fitting/case.h"

namespace rhytid::tools {

void add_clip_option(CLI::App& app, std::string& clip);

/// One view of a case, and the folder of its files, which is made.
struct ChosenView {
  fitting::Case of_view;
  std::string folder;
};

/// `folder` is that of the case's results. Throws InputError when a case with clips is given without one, or
/// there is no such clip.
ChosenView chosen_view(const fitting::Case& c, const std::string& clip, const std::string& folder);

}  // namespace rhytid::tools
