// What an optimiser minimises: F(t) = ½|z(t)|² within bounds, with the derivatives of z or of F. One clip
// (fit_problem.h) and several together (joint_problem.h) are objectives alike.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fitting/parametrisation.h"

namespace rhytid::fitting {

/// How well one set of values predicts; failed means that a run did not complete or a point left the view.
struct ObjectiveEvaluation {
  bool failed = true;
  std::string failure;  ///< one sentence when failed
  double cost = 0;      ///< F
  VectorXd residuals;   ///< z [num_residuals]
};

class Objective {
 public:
  virtual ~Objective() = default;

  virtual const std::vector<FitVariable>& variables() const = 0;
  virtual VectorXd initial() const = 0;  ///< transformed, inside the bounds
  virtual VectorXd lower() const = 0;    ///< transformed, finite
  virtual VectorXd upper() const = 0;
  int num_parameters() const { return static_cast<int>(variables().size()); }
  virtual int num_residuals() const = 0;

  /// Runs at t, or the kept evaluation when t is the same to the last bit.
  virtual const ObjectiveEvaluation& evaluate(const VectorXd& t) = 0;
  /// ∂z/∂t [num_residuals][num_parameters]; nothing (and `failure` of the evaluation set) when the run failed
  /// or cannot be differentiated. A point without derivative counts as failed from then on.
  virtual std::optional<MatrixXd> jacobian(const VectorXd& t) = 0;
  /// ∂F/∂t; nothing as above.
  virtual std::optional<VectorXd> gradient(const VectorXd& t) = 0;

  virtual int forward_runs() const = 0;  ///< evaluations so far that a budget counts
  virtual bool was_stopped() const = 0;  ///< by the user
  /// Why the last failed evaluation failed; empty before one did.
  virtual const std::string& last_failure() const = 0;
};

}  // namespace rhytid::fitting
