// Scenes that several tests start from.
#pragma once

namespace rhytid::testing {

/// Only what a scene must say.
inline constexpr const char* minimal_scene = R"({
  "skin": {
    "surface": {"grid": {"size": [20, 10], "cells": [4, 2]}},
    "layers": [{"name": "soft", "thickness": 2, "youngs_modulus": 0.02}]
  }
})";

/// Uses every part of the format at least once; lines are counted by tests.
inline constexpr const char* full_scene = R"({
  // a finger drags a two-layer patch
  "name": "drag", "description": "test",
  "skin": {
    "surface": {"grid": {"size": ["2 cm", 10], "cells": [8, 4], "pattern": "diagonal_plus", "bend_radius": "8 cm"},
                "side": "inner", "normal_smoothing": 1},
    "order": 4, "scheme": "stacked", "composite_order": 4,
    "quadrature": {"triangle_degree": 8, "thickness_points": 3, "contact_degree": 12},
    "rim": "sliding",
    "layers": [
      {"name": "soft", "thickness": "2 mm", "order": 3, "youngs_modulus": "20 kPa", "poissons_ratio": 0.45},
      {"name": "film", "thickness": "50 um", "youngs_modulus": "4 MPa", "stiffening": 0.5,
       "relaxing_fraction": "80 %", "relaxation_time": "100 ms"}
    ]
  },
  "ligaments": {
    "stiffness": "500 Pa", "smoothing": "10 µm", "diffusion_time": "20 mm^2",
    "sources": [
      {"name": "cheek", "position": [1, 2, "0.3 cm"], "strength": "0.8 1/mm", "radius": 5},
      {"name": "jaw", "vertex": 7, "strength": 2}
    ]
  },
  "base": {"shape": "sphere", "centre": [0, 0, -50], "radius": "5 cm", "stiffness": "2 MPa/mm"},
  "colliders": [
    {"name": "finger", "shape": "sphere", "radius": 8, "stiffness": 1,
     "friction": {"coefficient": 0.7, "slip_speed": "5 mm/s", "mollifier": "quadratic"},
     "path": [{"time": 0, "position": [0, 0, 9]}, {"time": "0.5 s", "position": [0, 0, 7]}]},
    {"name": "table", "shape": "plane", "normal": [0, 0, 2], "path": [{"time": 0, "position": [0, 0, 20]}]}
  ],
  "time": {"frame_rate": "24 Hz", "frames": 12, "substeps": 2, "max_bisections": 3, "damper": "strang"},
  "solver": {"minimiser": "lbfgs", "relative_tolerance": 1e-8, "absolute_tolerance": "1 uN", "max_iterations": 50,
             "lbfgs_memory": 10, "lbfgs_refresh": 50, "factor_precision": "full"},
  "output": {"vtu": false, "pictures": true, "csv": false, "every": 2}
})";

}  // namespace rhytid::testing
