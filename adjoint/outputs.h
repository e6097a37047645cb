// What is differentiated: quantities read off the state at the end of a frame, or off the step that led
// there.
//
//   q(u, s)                        Output: what the state shows (positions)
//   q(u, s; u_old, s_old, θ, t)    StepOutput: what also depends on where bodies are, on the old state or on
//                                  native parameters themselves (forces of contact and friction, energies)
//
// To add one: derive from either, give size, values, tangent and adjoint of one frame (they must pair:
// tests/adjoint checks <J v, w> = <v, Jᵀ w> for every output), and pass it to the sweeps. Nothing else needs
// to know.
#pragma once

#include <memory>
#include <vector>

#include "sim/time/model.h"

namespace rhytid::adjoint {

/// Derivatives along k directions at a step: of its end, of its start and of the native parameters. A step
/// solved in several passes: the start of its last pass, whose lag is that of the pass before.
struct StepDirections {
  MatrixXd du, ds;          ///< [num_nodes·3][k], [history][k]
  MatrixXd du_old, ds_old;  ///< the same at the start
  MatrixXd dnative;         ///< [native size][k]
};

/// What the transposed derivative of an output at a step is added to; shapes as in StepDirections, one
/// column.
struct StepBars {
  VectorXd &u, &s, &u_old, &s_old, &native;
};

/// A vector-valued function of the state at the end of a frame (0 = rest). Immutable while a sweep runs.
class Output {
 public:
  virtual ~Output() = default;
  /// Number of values in this frame; 0 when the output does not look at it.
  virtual int size(int frame) const = 0;
  /// Values at the state, [size(frame)].
  virtual VectorXd values(int frame, const State& state) const = 0;
  /// Derivative along k directions: du [num_nodes·3][k], ds [history][k] → [size(frame)][k].
  virtual MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const = 0;
  /// Adds the transposed derivative applied to weights [size(frame)] to u_bar and s_bar.
  virtual void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
                       VectorXd& s_bar) const = 0;

  /// The same three as the sweeps ask for them, with the (last pass of the) step that led to the frame; frame
  /// 0 of a run that starts at rest has none. Here: nothing but the state matters.
  virtual VectorXd step_values(int frame, const StepProblem& step, const State& state) const;
  virtual MatrixXd step_tangent(int frame, const StepProblem& step, const State& state,
                                const StepDirections& directions) const;
  virtual void step_adjoint(int frame, const StepProblem& step, const State& state, const VectorXd& weights,
                            StepBars& bars) const;
};

/// An output that the state alone does not tell: derive and give the three functions of a step. It has no
/// value where no step led: asked at rest it throws ContractError.
class StepOutput : public Output {
 public:
  VectorXd values(int frame, const State& state) const final;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const final;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const final;
  VectorXd step_values(int frame, const StepProblem& step, const State& state) const override = 0;
  MatrixXd step_tangent(int frame, const StepProblem& step, const State& state,
                        const StepDirections& directions) const override = 0;
  void step_adjoint(int frame, const StepProblem& step, const State& state, const VectorXd& weights,
                    StepBars& bars) const override = 0;
};

/// A point fixed to the skin: a place on the inner or outer surface in natural coordinates of a face.
struct MaterialPoint {
  int face = 0;
  double u = 0, v = 0;  ///< natural coordinates on the face
  bool outer = true;
};

/// Interpolation of nodal values at material points: positions are linear in the displacement.
class PointInterpolation {
 public:
  PointInterpolation(const SkinMesh& mesh, std::vector<MaterialPoint> points);
  int num_points() const { return static_cast<int>(points_.size()); }
  const std::vector<MaterialPoint>& points() const { return points_; }
  Vec3 rest(int point) const { return rest_.row(point).transpose(); }
  Vec3 displacement(int point, const VectorXd& u) const;
  /// Position = rest + displacement, mm.
  Vec3 position(int point, const VectorXd& u) const { return rest(point) + displacement(point, u); }
  /// d displacement along directions du [num_nodes·3][k] → [3][k].
  MatrixXd tangent(int point, const MatrixXd& du) const;
  /// Adds the transpose: u_bar += Nᵀ weight.
  void adjoint(int point, const Vec3& weight, VectorXd& u_bar) const;

 private:
  std::vector<MaterialPoint> points_;
  int num_nodes_;
  std::vector<int> nodes_;       ///< [points][num_nodes_]
  std::vector<double> weights_;  ///< same shape
  MatrixX3 rest_;
};

/// Positions [3·points] of material points at every frame from `first_frame` on.
class PointPositions final : public Output {
 public:
  PointPositions(const SkinMesh& mesh, std::vector<MaterialPoint> points, int first_frame = 1)
      : interpolation_(mesh, std::move(points)), first_frame_(first_frame) {}
  int size(int frame) const override { return frame >= first_frame_ ? 3 * interpolation_.num_points() : 0; }
  VectorXd values(int frame, const State& state) const override;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const override;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const override;
  const PointInterpolation& interpolation() const { return interpolation_; }

 private:
  PointInterpolation interpolation_;
  int first_frame_;
};

/// Mean over material points of the displacement along the rest normal, mm: one value per frame from
/// `first_frame` on.
class MeanNormalDisplacement final : public Output {
 public:
  MeanNormalDisplacement(const SkinMesh& mesh, std::vector<MaterialPoint> points, int first_frame = 1);
  int size(int frame) const override { return frame >= first_frame_ ? 1 : 0; }
  VectorXd values(int frame, const State& state) const override;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const override;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const override;

 private:
  PointInterpolation interpolation_;
  MatrixX3 normals_;  ///< [points] unit, divided by the number of points
  int first_frame_;
};

/// Several outputs, one after the other in every frame.
class CombinedOutput final : public Output {
 public:
  explicit CombinedOutput(std::vector<std::shared_ptr<const Output>> parts) : parts_(std::move(parts)) {}
  int size(int frame) const override;
  VectorXd values(int frame, const State& state) const override;
  MatrixXd tangent(int frame, const State& state, const MatrixXd& du, const MatrixXd& ds) const override;
  void adjoint(int frame, const State& state, const VectorXd& weights, VectorXd& u_bar,
               VectorXd& s_bar) const override;
  VectorXd step_values(int frame, const StepProblem& step, const State& state) const override;
  MatrixXd step_tangent(int frame, const StepProblem& step, const State& state,
                        const StepDirections& directions) const override;
  void step_adjoint(int frame, const StepProblem& step, const State& state, const VectorXd& weights,
                    StepBars& bars) const override;

 private:
  /// Calls visit(part, first value, number of values) for every part with values in the frame.
  template <class Visit>
  void for_parts(int frame, Visit&& visit) const;
  std::vector<std::shared_ptr<const Output>> parts_;
};

}  // namespace rhytid::adjoint
