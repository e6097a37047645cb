// The single numbers that frames show besides positions, with their derivatives: forces on colliders, the energy
// that is stored, and descriptors of wrinkles where an experiment measures them.
//
//   |F|           force of the skin on a collider, N                adjoint/resultant_force.h
//   E             stored energy, mJ                                 adjoint/stored_energy.h
//   A, λ, φ, c    amplitude, wavelength (mm), direction of the wave vector (deg) and coherence of wrinkles
//                 on the line and in the window of the experiment   adjoint/wrinkle_output.h
//
// φ = ½ atan2(s, c'), c = √(c'² + s²) of the smooth pair (c', s) there; nothing where it vanishes.
// Tests: tests/tools/study_gradients_test.cpp
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "adjoint/outputs.h"
#include "tools/study/experiment.h"

namespace rhytid::tools {

/// One number over the frames 1.. of a run. NaN where it has no value or no derivative (flat skin has no
/// wavelength).
struct ShownFigure {
  std::string name, unit;
  bool relative = false;  ///< a size, of which per cents say something (angles and coherence are none)
  VectorXd values;        ///< [frames]
  MatrixXd derivatives;   ///< [frames][n], per unit of each coordinate
};

/// What is sampled of a run, as one output of a sweep.
class ShownFigures {
 public:
  /// Throws InputError when the experiment's line or window lies beside the surface.
  ShownFigures(const Model& model, const WrinkleMeasure& measure);

  /// All of it, frames 1 and later.
  const std::shared_ptr<const adjoint::Output>& output() const { return output_; }

  /// Figures from the output's values and tangents, both per frame from 0 on.
  std::vector<ShownFigure> figures(const std::vector<VectorXd>& values,
                                   const std::vector<MatrixXd>& tangents) const;

 private:
  struct Part;
  std::vector<Part> parts() const;

  std::vector<std::string> colliders_;
  bool has_line_ = false, has_window_ = false;
  std::shared_ptr<const adjoint::Output> output_;
};

}  // namespace rhytid::tools
