// A scene made ready to run: prism mesh, the energy terms the scene needs (and no others), native parameters,
// constraints and sparsity.
//
// Residual convention: R = +∂W/∂u; the internal force is −R. Unknowns q: per free node its three components
// in the node's own frame (identity but for sliding rims), so that every constraint fixes single components.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sim/mesh/skin_mesh.h"
#include "sim/solve/minimise.h"
#include "sim/surface/implicit_shape.h"
#include "sim/terms/path.h"
#include "sim/terms/term.h"
#include "sim/time/state.h"

namespace rhytid {

/// A named run of native parameters.
struct NativeBlock {
  std::string name;  ///< e.g. "layer/film", "ligaments/b", "collider/finger/path"
  int offset = 0, size = 0;
  /// Entries that scale all energies when multiplied together (moduli, k, κ): the gauge direction.
  std::vector<int> stiffness_like;  ///< indices into the native vector
};

/// Nodes that are moved together, by a displacement given over time. They are fully fixed (no block).
struct MovedNodes {
  std::vector<int> nodes;
  KnotPath path;
  std::vector<Vec3> displacements;  ///< [knots] mm
};

/// Per node: which of its components are unknowns.
struct Constraints {
  std::vector<int> block;           ///< [num_nodes] block index, −1 = fully fixed: at zero, or moved
  std::vector<int> block_nodes;     ///< [num_blocks] node
  std::vector<Mat3> frames;         ///< per framed block: columns are the frame's axes
  std::vector<int> frame_of_block;  ///< [num_blocks] index into frames, −1 = identity
  std::vector<int> fixed_unknowns;  ///< unknowns q that stay zero
  std::vector<MovedNodes> moved;
};

class Model {
 public:
  SkinMesh mesh;
  std::vector<Term> terms;
  std::vector<std::shared_ptr<const ImplicitShape>> shapes;  ///< owned here, referenced by contact laws
  VectorXd native;                                           ///< current native parameter values
  std::vector<NativeBlock> native_blocks;
  Constraints constraints;
  /// Native parameter by which the clock of everything that moves (paths of colliders and held parts) runs
  /// ahead of the steps' time, s; −1 = nothing moves.
  int clock = -1;

  /// Assigns history slices and builds the sparsity. Call once, after terms and constraints are set.
  void finish();

  int num_nodes() const { return mesh.num_nodes(); }
  const BlockPattern& pattern() const { return *pattern_; }
  std::size_t history_size() const { return history_size_; }
  std::size_t history_offset(std::size_t term) const { return history_offsets_[term]; }
  /// The rest state: zero displacement, C^v = I, no lagged pressure.
  State rest_state() const;
  /// Displacement of the moved nodes at time t of their paths and zero elsewhere [num_nodes·3], mm; empty when
  /// no node is moved.
  VectorXd given_displacement(double t) const;
  /// Its rate, mm/s (KnotPath::rates).
  VectorXd given_velocity(double t) const;
  /// How far the clock runs ahead with these native values, s.
  double ahead(const VectorXd& values) const { return clock >= 0 ? values[clock] : 0; }
  /// Whether a path has a kink (its velocity jumps at a knot) within `room` s of a time that the clock shows
  /// at one of `times`: results are then not differentiable by how far it runs ahead.
  bool clock_meets_kink(const VectorXd& values, const std::vector<double>& times, double room) const;
  /// Native parameters that are contact penalties κ.
  std::vector<int> penalties() const;
  const NativeBlock& native_block(const std::string& name) const;  ///< throws ContractError when absent

  /// Unknowns from displacements and back (a gradient maps like a displacement; fixed components read as
  /// zero, those of moved nodes too: StepProblem::displacement adds them).
  VectorXd to_unknowns(const VectorXd& u) const;
  VectorXd to_displacement(const VectorXd& q) const;
  /// Same for k columns at once, [num_nodes·3][k] → [num_unknowns][k].
  MatrixXd to_unknowns(const MatrixXd& u) const;
  MatrixXd to_displacement(const MatrixXd& q) const;

 private:
  std::shared_ptr<const BlockPattern> pattern_;
  std::size_t history_size_ = 0;
  std::vector<std::size_t> history_offsets_;
};

/// One step's problem: energies of all terms with the old state prepared. The model, native vector and old
/// state must outlive it.
class StepProblem final : public Objective {
 public:
  StepProblem(const Model& model, const VectorXd& native, const StepInfo& step, const State& old);
  const BlockPattern& pattern() const override { return model_->pattern(); }
  double energy(const VectorXd& q, VectorXd* gradient) override;
  double force_scale() const override { return force_scale_; }
  void hessian(const VectorXd& q, Curvature curvature, BlockMatrix& out) override;
  double largest_feasible_step(const VectorXd& q, const VectorXd& d) override;

  /// Displacement of all nodes at the step's end for unknowns q, moved nodes included.
  VectorXd displacement(const VectorXd& q) const;
  /// Derivative of the moved nodes' displacement by the clock [num_nodes·3], mm/s; empty when nothing is moved
  /// at that time.
  VectorXd given_by_clock() const;
  /// Energy, gradient by unknowns (when asked and finite) and Hessian where the skin has displacement u,
  /// which need not agree with where the step moves its nodes.
  double energy_at(const VectorXd& u, VectorXd* gradient);
  void hessian_at(const VectorXd& u, Curvature curvature, BlockMatrix& out);

  /// K v with the raw Hessian K at u [num_nodes·3], rows and columns of fixed nodes included, N.
  VectorXd hessian_times(const VectorXd& u, const VectorXd& v) const;

  const Model& model() const { return *model_; }
  const VectorXd& native() const { return *native_; }
  const StepInfo& step() const { return step_; }
  const State& old() const { return *old_; }
  const TermStepData& data(std::size_t term) const { return data_[term]; }
  /// Residual in displacement components [num_nodes·3], fixed components included (reactions). Throws
  /// ContractError naming the term when u lies outside the domain (an inverted element, a point behind the
  /// base): there is no residual there.
  VectorXd residual(const VectorXd& u) const;
  /// Energy of each term at u, mJ.
  std::vector<double> term_energies(const VectorXd& u) const;
  /// Where to start the minimiser: the old displacement, or that moved on by the old velocity if the energy
  /// is lower there (on drags it halves the iterations; where a finger turns or stops, the energy refuses
  /// it). Counts its evaluations in `work`.
  VectorXd first_guess(MinimiserReport& work);
  /// When the step moves nodes: the old displacement and the skin's linear response to that motion, by one
  /// solve with the projected Hessian at the old state. Empty when nothing is moved or there is no such
  /// factor. Counts its evaluations and its factorisation in `work`.
  VectorXd response_to_given_motion(CholeskyFactor& factor, BlockMatrix& matrix, MinimiserReport& work);
  /// The old state with the lag (pressure and normal of friction) that the step would leave if it ended at u:
  /// what another pass over the same step starts from.
  State relagged(const VectorXd& u) const;
  /// The state after the step, given its converged displacement.
  State advance(const VectorXd& u) const;

 private:
  const Model* model_;
  const VectorXd* native_;
  StepInfo step_;
  const State* old_;
  std::vector<TermStepData> data_;
  VectorXd given_;  ///< Model::given_displacement at the step's end
  double force_scale_ = 0;
};

}  // namespace rhytid
