// The variables of a fit: scene parameters p seen through transforms t, with bounds and the penalty tie.
//
//   log: t = ln p     logit: t = ln((p − lower)/(upper − p))     none: t = p
//
// With displacements alone, all moduli, ligament and penalty stiffnesses can be scaled together without any
// effect. One modulus is therefore held (the gauge layer's), and contact penalties follow that modulus when
// it is fitted all the same: κ = κ_scene · E_gauge / E_gauge,scene, so that no fixed penalty in MPa/mm
// becomes the yardstick of the tissue.
//
// Source   the potential is homogeneous in all stiffnesses: tests/verification/README.md, T16
// Tests    tests/fitting/fit_test.cpp
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fitting/case.h"
#include "sim/scene/scene_model.h"

namespace rhytid::fitting {

/// One variable; numbers of the parameter in internal units.
struct FitVariable {
  std::string address, name, unit;
  ParameterTransform transform = ParameterTransform::none;
  double initial = 0, lower = 0, upper = 0;
  std::optional<double> prior_sigma;  ///< of t, around the initial value
  /// Addresses that move by so much per unit; empty: `address` is set itself.
  std::vector<std::pair<std::string, double>> moves = {};

  double to_transformed(double p) const;
  double to_parameter(double t) const;
  double derivative(double t) const;  ///< dp/dt
};

class Parametrisation {
 public:
  /// `scene` supplies what the case leaves open. Throws InputError for unknown or repeated addresses, bounds
  /// that are empty, or that the scene or the transform does not allow, an initial value outside them, an
  /// unknown gauge layer, or a scene without any parameter to fit.
  Parametrisation(const Scene& scene, const FitCase& fit);

  int size() const { return static_cast<int>(variables_.size()); }
  const std::vector<FitVariable>& variables() const { return variables_; }
  VectorXd initial() const { return initial_; }  ///< transformed, inside the bounds
  VectorXd lower() const { return lower_; }      ///< transformed, finite
  VectorXd upper() const { return upper_; }

  VectorXd values(const VectorXd& t) const;  ///< parameters, internal units
  /// The scene with these values, penalties following the gauge layer. Throws InputError (out of range).
  Scene scene(const VectorXd& t) const;
  /// ∂native/∂t [native size][size()].
  MatrixXd native_directions(const SceneModel& model, const VectorXd& t) const;

  const std::string& gauge_layer() const { return gauge_layer_; }
  /// True when every stiffness-like parameter that does not follow the gauge layer is fitted together with
  /// it: then only ratios can come out.
  bool gauge_is_free() const { return gauge_is_free_; }
  /// Says what was held and why.
  std::string gauge_sentence() const;
  /// Index of the Young's modulus of a layer among the variables, −1 = held.
  int modulus_variable(const std::string& layer) const;

 private:
  void add_variable(const FitParameter& parameter);
  std::vector<std::string> penalties_that_follow() const;

  Scene scene_;
  std::vector<FitVariable> variables_;
  VectorXd initial_, lower_, upper_;
  std::string gauge_layer_;
  double gauge_modulus_ = 0;            ///< MPa, in the scene
  std::vector<std::string> following_;  ///< addresses of penalties
  bool gauge_is_free_ = false;
};

}  // namespace rhytid::fitting
