// Small scenes for tests of whole runs: a two-layer patch dragged by a finger, with every feature.
#pragma once

#include <string>
#include <vector>

namespace rhytid::test {

/// Patch 16 × 12 mm, soft 1.5 mm under film 0.15 mm, ligaments from two sources, plane base, a finger that
/// presses and drags: contact, slip, stick, viscosity, ligaments. Frames at 24 Hz. `order`, `frames` and
/// `scheme` as in the scene.
inline std::string drag_scene(int order, int frames, const std::string& scheme = "stacked",
                              const std::string& rim = "clamped") {
  return R"({
  "name": "drag",
  "skin": {
    "surface": {"grid": {"size": ["16 mm", "12 mm"], "cells": [5, 4]}},
    "order": )" +
         std::to_string(order) + R"(,
    "scheme": ")" +
         scheme + R"(", "rim": ")" + rim + R"(",
    "layers": [
      {"name": "soft", "thickness": "1.5 mm", "order": 2, "youngs_modulus": "20 kPa"},
      {"name": "film", "thickness": "0.15 mm", "order": 1, "youngs_modulus": "1 MPa"}
    ]
  },
  "ligaments": {
    "stiffness": "0.5 kPa", "smoothing": "0.05 mm", "diffusion_time": "8 mm^2",
    "sources": [
      {"name": "left", "position": [-5, 1, 0], "strength": 0.5, "radius": "6 mm"},
      {"name": "right", "position": [5, -1, 0], "strength": 3, "radius": "6 mm"}
    ]
  },
  "base": {"shape": "plane", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm"},
  "colliders": [
    {"name": "finger", "shape": "sphere", "radius": "5 mm", "stiffness": "0.1 MPa/mm", "onset": "0.02 mm",
     "friction": {"coefficient": 0.4, "slip_speed": "2 mm/s"},
     "path": [{"time": 0, "position": [-2, 0, 5.02]}, {"time": 0.125, "position": [-2, 0, 4.5]},
              {"time": 1, "position": [8, 2, 4.5]}]}
  ],
  "time": {"frame_rate": "24 Hz", "frames": )" +
         std::to_string(frames) + R"(}
})";
}

/// Settings that make the drag scene cheap: a coarser mesh, everything else as it is.
inline std::vector<std::string> coarse() {
  return {"/skin/surface/grid/cells=[4,3]"};
}

}  // namespace rhytid::test
