// Scene parameters as coordinates without units, zero at the scene's own values: what random directions,
// steps of a Taylor test and sizes of gradients are measured in.
//
//   log    p = p₀ eˣ        logit  ln((p−l)/(u−p)) = ln((p₀−l)/(u−p₀)) + x        none   p = p₀ + x s,
//   s = (u−l)/2
//
// Tests    tests/adjoint/sweeps_test.cpp
#pragma once

#include <string>
#include <vector>

#include "sim/scene/parameter.h"
#include "sim/scene/scene_model.h"

namespace rhytid::adjoint {

/// What a unit of a parameter's coordinate is.
struct Coordinate {
  ParameterTransform transform = ParameterTransform::none;  ///< the one in use
  double scale = 0;  ///< s of a plain coordinate, in the parameter's unit (mm of a place); 0 for the others
};

/// The coordinate of a parameter as the scene describes it. A value that its transform cannot hold (0 under a
/// logarithm, outside the bounds of a logit) has a plain one with s = |p₀|, or u − l when p₀ = 0.
Coordinate coordinate_of(const ParameterSpec& spec);

/// Coordinates of some addresses of a scene. The scene model must outlive it.
class ParameterSpace {
 public:
  /// Throws InputError for an address that is not fit-able.
  ParameterSpace(const SceneModel& scene_model, const std::vector<std::string>& addresses);

  int size() const { return static_cast<int>(specs_.size()); }
  const std::vector<ParameterSpec>& specs() const { return specs_; }
  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  /// p at coordinates x [size], internal units.
  std::vector<double> values(const VectorXd& x) const;
  /// The scene with those values. Throws InputError when a value leaves what a scene may hold.
  Scene scene(const VectorXd& x) const;
  VectorXd native(const VectorXd& x) const { return scene_model_->native(scene(x)); }
  /// ∂native/∂x at x = 0, [native size][size].
  const MatrixXd& jacobian() const { return jacobian_; }

 private:
  double value(int k, double x) const;

  const SceneModel* scene_model_;
  std::vector<ParameterSpec> specs_;  ///< transform: the one in use
  std::vector<Coordinate> coordinates_;
  MatrixXd jacobian_;
};

}  // namespace rhytid::adjoint
