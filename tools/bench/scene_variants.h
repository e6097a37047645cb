// A scene with one of its features left out, or with one more: what `bench features` compares.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sim/scene/scene.h"

namespace rhytid::tools {

/// What is kept and written while a variant runs.
struct VariantOutput {
  bool files = false;      ///< fields and pictures of every frame
  bool states = false;     ///< all states, without their histories
  bool histories = false;  ///< with them: what a gradient needs
};

struct SceneVariant {
  std::string name;  ///< "all features", "without ligaments", "with pre-stretch", ...
  Scene scene;
  VariantOutput output;
};

/// The scene itself first, then one variant per feature: without it where the scene has it. Some have a variant with
/// them where the scene is without: pre-stretch, the full quadrature, reduced volume rule, substeps; files and states
/// are always added.
/// Without colliders the part of the skin under the first one is moved along its path instead.
std::vector<SceneVariant> scene_variants(const Scene& scene);

}  // namespace rhytid::tools
