// The scenes that benchmarks measure: a flat patch of skin with every feature, at any number of nodes, or a
// scene of the user's.
#pragma once

#include <string>
#include <vector>

#include "sim/scene/scene.h"
#include "tools/verb.h"

namespace rhytid::tools {

/// JSON of a patch 40 × 30 mm, 2.4 mm of soft tissue under a film of 0.2 mm (stacked, orders 3 and 2, in-plane
/// order 3), both viscoelastic, with ligaments from three sources, on a plane. A finger of radius 9 mm presses
/// 1 mm deep in five frames and then drags at 15 mm/s: contact, slip and stick. The grid is as fine as makes
/// about `nodes` nodes (at least 600). Frames at 24 Hz.
std::string drag_patch_scene(int nodes, int frames);

struct BenchScene {
  std::string name;  ///< "patch_2000", or the file
  Scene scene;
};

/// Options --scene, --set, --nodes and --frames, and the scenes that they name.
class BenchSceneOptions {
 public:
  explicit BenchSceneOptions(int frames) : frames_(frames) {}
  void add_options(CLI::App& app);
  /// The user's scene, of which --frames keeps the first, or patches, whose files are written into `folder`;
  /// settings of the command line apply to either. Throws InputError as load_scene does.
  std::vector<BenchScene> load(VerbContext& context, const std::string& folder) const;

 private:
  int frames_;
  bool frames_given_ = false;
  std::vector<int> nodes_ = {2000, 8000};
  std::string file_;
  std::vector<std::string> settings_;
};

}  // namespace rhytid::tools
