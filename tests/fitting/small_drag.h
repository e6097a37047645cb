// The small drag whose model is wrong in some way: film and a source's strength are fitted to tracks of the scene as it is,
// with a scene that may be another.
#pragma once

#include <cmath>

#include "tests/fitting/synthetic_tracks.h"

namespace rhytid::fitting::test {

inline constexpr int kDragFrames = 4;

/// Nothing is considered, finer steps are not looked at.
inline FitInput small_drag(const std::vector<std::string>& settings = {}) {
  const Camera camera = make_camera();
  FitCase fit = three_parameters();
  fit.parameters = {fitted("/ligaments/sources/right/strength", 2.5),
                    fitted("/skin/layers/film/youngs_modulus", 0.8)};
  return {drag_scene(kDragFrames, settings),
          camera,
          make_tracks(drag_scene(kDragFrames), camera, 4, 0.02, 3),
          fit,
          {}};
}

/// Where both parameters are fitted by their logarithms.
inline VectorXd logarithms(const FitResult& result) {
  VectorXd t(result.parameters.size());
  for (Eigen::Index k = 0; k < t.size(); ++k) t[k] = std::log(result.parameters[k].value);
  return t;
}

/// Intervals of these two that hold the truth.
inline int intervals_that_hold(const FitResult& result) {
  int count = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    const FittedParameter& p = result.parameters[k];
    const double truth = get_parameter(drag_scene(kDragFrames), p.address);
    count += p.low95 <= truth && truth <= p.high95 ? 1 : 0;
  }
  return count;
}

}  // namespace rhytid::fitting::test
