#include "tools/bench/bench_scenes.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>

#include "sim/output/atomic_file.h"
#include "sim/scene/load.h"
#include "tools/scene_argument.h"
#include "tools/study/study_run.h"

namespace rhytid::tools {

std::string drag_patch_scene(int nodes, int frames) {
  // Six layers of nodes, (3 cx + 1)(3 cy + 1) in each, cx : cy = 4 : 3.
  const double cells = std::sqrt(nodes / 6. / 9 / 12);
  const int cx = std::max(4, static_cast<int>(std::lround(4 * cells))),
            cy = std::max(3, static_cast<int>(std::lround(3 * cells)));
  return R"({
  "name": "drag patch",
  "skin": {
    "surface": {"grid": {"size": ["40 mm", "30 mm"], "cells": [)" +
         std::to_string(cx) + ", " + std::to_string(cy) + R"(]}},
    "order": 3,
    "layers": [
      {"name": "soft", "thickness": "2.4 mm", "order": 3, "youngs_modulus": "20 kPa"},
      {"name": "film", "thickness": "0.2 mm", "order": 2, "youngs_modulus": "1 MPa"}
    ]
  },
  "ligaments": {
    "stiffness": "0.5 kPa", "smoothing": "0.05 mm", "diffusion_time": "20 mm^2",
    "sources": [
      {"name": "left", "position": [-10, 2, 0], "strength": 2, "radius": "7 mm"},
      {"name": "right", "position": [9, 8, 0], "strength": 1, "radius": "7 mm"},
      {"name": "low", "position": [8, -8, 0], "strength": 3, "radius": "7 mm"}
    ]
  },
  "base": {"shape": "plane", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm"},
  "colliders": [
    {"name": "finger", "shape": "sphere", "radius": "9 mm", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm",
     "friction": {"coefficient": 0.6, "slip_speed": "2 mm/s"},
     "path": [{"time": 0, "position": [-4, 0, 9.02]}, {"time": "0.2083333333333 s", "position": [-4, 0, 8]},
              {"time": "1.2083333333333 s", "position": [11, 2, 8]}]}
  ],
  "time": {"frame_rate": "24 Hz", "frames": )" +
         std::to_string(frames) + R"(}
})";
}

void BenchSceneOptions::add_options(CLI::App& app) {
  app.add_option("--nodes", nodes_, "sizes of the patch (default 2000,8000)")
      ->delimiter(',')
      ->option_text("N,...")
      ->check(CLI::Range(600, 1000000));
  app.add_option("--frames", frames_,
                 "frames of the drag over the patch (default " + std::to_string(frames_) +
                     "); with --scene its first N (default all)")
      ->option_text("N")
      ->each([this](const std::string&) { frames_given_ = true; })
      ->check(CLI::Range(1, 10000));
  app.add_option("--scene", file_, "a scene of yours instead of the patch")->option_text("FILE");
  app.add_option("--set", settings_, "change one value of the scenes; may be repeated")
      ->option_text("/POINTER=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

std::vector<BenchScene> BenchSceneOptions::load(VerbContext& context, const std::string& folder) const {
  std::vector<BenchScene> scenes;
  if (!file_.empty()) {
    scenes.push_back({file_, load_scene_argument(file_, settings_, context.progress)});
    require_frames(scenes.front().scene, file_);
    int& frames = scenes.front().scene.time.frames;
    if (frames_given_) frames = std::min(frames, frames_);
    return scenes;
  }
  for (const int nodes : nodes_) {
    const std::string name = "patch_" + std::to_string(nodes), text = drag_patch_scene(nodes, frames_);
    write_file(folder + "/" + name + ".json", text);
    scenes.push_back({name, parse_scene_text(text, name, settings_)});
    require_frames(scenes.back().scene, name);
  }
  return scenes;
}

}  // namespace rhytid::tools
