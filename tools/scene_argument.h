// The scene that a command line names: FILE is a scene, or a case, which is taken for its scene.
// Tests: tests/tools/forward_verbs.sh
#pragma once

#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "tools/progress.h"

namespace rhytid::tools {

/// Loads the scene of `file` with the overrides `settings`, "/pointer=value". A case gives the scene that its
/// fit uses, with the case's own settings before those of the command line; a note on `progress` says so. Of
/// the latter, those that address a key that only cases have (/settings/0=...) change the case. Throws
/// InputError as load_scene does.
Scene load_scene_argument(const std::string& file, const std::vector<std::string>& settings,
                          Progress& progress);

/// The scene's name, or without one that of its file or folder: "elastic_patch".
std::string shown_name(const Scene& scene);

}  // namespace rhytid::tools
