// What pages say of the scene's schemes and of the program that made them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "sim/scene/scene_model.h"

namespace rhytid::tools {

/// Term and description, for HtmlPage::facts.
using Facts = std::vector<std::pair<std::string, std::string>>;

/// Scene, elements, layers, time, damper, minimiser.
Facts scheme_facts(const SceneModel& model);

/// Version, compiler, BLAS.
Facts build_facts();

/// A word of a command line: quoted for a shell unless every character is harmless.
std::string shell_word(const std::string& word);

}  // namespace rhytid::tools
