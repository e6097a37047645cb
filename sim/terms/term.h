// An energy term: a law at quadrature points, where those points are, and where its parameters come from.
//
// A term is const while a step is solved. Everything it carries from step to step is its slice of
// State::history; what a step needs of the old state is prepared once per step (StepData). Tangent and
// adjoint blocks come from the generic kernels, so a new term is a law (one header) and a builder.
//
// Parameters reach the points by a linear map of the model's native parameter vector: a constant slot, a
// field over the columns (ligament b), or a position on a collider's path. The map and its transpose are the
// only way in and out. It is linear but for the time at which paths are read: their clock may run ahead of the
// step's by another native parameter, and the map then has the rates of the paths as its derivative.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sim/core/cache_line.h"
#include "sim/core/types.h"
#include "sim/core/work_count.h"
#include "sim/terms/kernel_table.h"
#include "sim/terms/path.h"

namespace rhytid {

class BlockMatrix;

/// One implicit step.
struct StepInfo {
  int index = 0;     ///< 0-based
  double t_old = 0;  ///< s
  double t = 0;      ///< s
  double dt() const { return t - t_old; }
};

/// Where one of a law's parameters comes from: the native vector, or a number that is no parameter.
struct ThetaSlot {
  enum class Kind { constant, field, path_now, path_old, fixed };
  Kind kind = Kind::constant;
  int offset = 0;  ///< of the constant, of column 0, or of the first knot's coordinate
  std::shared_ptr<const KnotPath> path = nullptr;  ///< path_now, path_old
  int stride = 3;                                  ///< knot k's coordinate is native[offset + stride·k]
  double value = 0;                                ///< fixed
};

/// The factors of a prism's table, where it has them (ProductView has the shapes).
struct ProductTables {
  int plane_nodes = 0, padded_plane_nodes = 0, line_nodes = 0, line_points = 0, padded_plane_rows = 0;
  CacheLineDoubles plane, line, plane_by_node;
  ProductView view() const {
    return {plane_nodes,  padded_plane_nodes, line_nodes,           line_points,
            plane.data(), line.data(),        plane_by_node.data(), padded_plane_rows};
  }
};

/// Elements of one shape and one parameter set; the arrays' shapes are those of ElementView with a leading
/// element index.
struct TermGroup {
  int num_elements = 0, num_nodes = 0, num_points = 0;
  int padded_nodes = 0, padded_rows = 0;
  std::vector<int> nodes;                ///< [num_elements][num_nodes] mesh nodes
  std::vector<double> node_by_row;       ///< [num_points·R][padded_nodes]
  std::vector<double> rows_by_node;      ///< [num_nodes][padded_rows]
  ProductTables product;                 ///< prisms with a product rule
  std::vector<double> inverse_jacobian;  ///< [num_elements][num_points][9], prisms only
  std::vector<double> weight;            ///< [num_elements][num_points]
  std::vector<double> rest;              ///< [num_elements][num_points][nrest]
  std::vector<ThetaSlot> theta;          ///< one per law parameter
  std::vector<int> field_columns;        ///< [num_elements][num_points][3], when a slot is a field
  std::vector<double> field_weights;     ///< same shape, rows sum to 1
  std::vector<int> cliques;              ///< [num_elements] index in the model's BlockPattern
  int first_point = 0;                   ///< of this group within the term
  int material = -1;                     ///< layer index for skin, −1 otherwise
};

/// What a step needs of the old state, per term: prepared old-state data and the parameters at the points.
struct TermStepData {
  std::vector<double> prepared;            ///< [num_points][np]
  std::vector<std::vector<double>> theta;  ///< per group: one row, or [num_elements·num_points][ntheta]
  double ahead = 0;                        ///< s by which the clock of paths runs ahead
  std::vector<std::vector<double>> rates;  ///< per group [ntheta]: derivative of theta by `ahead`, 1/s
};

/// Calls of a term's functions: work actually done.
struct TermCounters {
  WorkCount prepare, energy, gradient, hessian, update;
  WorkCount tangent, adjoint;  ///< of sweeps for derivatives
};

class Term {
 public:
  /// `law` is plain data that matches the kernels and is kept for the life of the term; name as the user
  /// knows it.
  template <class Law>
  Term(std::string name, const KernelTable& kernels, const Law& law)
      : name_(std::move(name)), kernels_(&kernels), law_(std::make_shared<Law>(law)) {}

  const std::string& name() const { return name_; }
  const KernelTable& kernels() const { return *kernels_; }
  const std::vector<TermGroup>& groups() const { return groups_; }
  std::vector<TermGroup>& groups() { return groups_; }
  /// Adds a group (fills padding and transposes from node_by_row given unpadded [num_points·R][num_nodes]).
  void add_group(TermGroup group);
  /// The native parameter, s, by which the clock of this term's paths runs ahead of the step's; −1 = none.
  void set_clock(int native_index) { clock_ = native_index; }
  int num_points() const { return num_points_; }
  /// Doubles of State::history that belong to this term.
  std::size_t history_size() const { return static_cast<std::size_t>(num_points_) * kernels_->ns; }
  /// Memory of the groups' arrays, bytes. History and prepared data are not part of it.
  std::size_t bytes() const;
  /// The law's own data, for tests and reports.
  template <class Law>
  const Law& law() const {
    return *static_cast<const Law*>(law_.get());
  }

  /// Parameters at the points from a native vector.
  std::vector<std::vector<double>> load_theta(const StepInfo& step, const VectorXd& native) const {
    return map_theta(step, native, ahead(native), 1);
  }
  /// Their derivative along a direction in the native vector, at a prepared step.
  std::vector<std::vector<double>> load_theta_direction(const StepInfo& step, const TermStepData& data,
                                                        const VectorXd& dnative) const;
  /// Transpose of load_theta_direction: adds theta_bar [num_points][ntheta] to native_bar.
  void add_theta_transpose(const StepInfo& step, const TermStepData& data,
                           const std::vector<double>& theta_bar, VectorXd& native_bar) const;

  /// Prepares a step. u is [num_nodes·3]; history is this term's slice.
  void prepare(const StepInfo& step, const VectorXd& native, const VectorXd& u_old, const double* s_old,
               TermStepData& data) const;
  /// Energy [mJ]; adds to gradient [num_nodes·3] and to |forces| (same shape) unless null. +inf outside the
  /// domain.
  double energy(const StepInfo& step, const TermStepData& data, const VectorXd& u, VectorXd* gradient,
                VectorXd* absolute) const;
  /// Where assembled element matrices go.
  class MatrixSink {
   public:
    virtual ~MatrixSink() = default;
    /// dense is [3n][3n], node-major; called in a fixed order, one at a time, by any thread.
    virtual void add(const TermGroup& group, int element, double* dense) = 0;
  };
  void hessian(const StepInfo& step, const TermStepData& data, const VectorXd& u, bool projected,
               MatrixSink& sink) const;
  /// New history slice.
  void update(const StepInfo& step, const TermStepData& data, const VectorXd& u, double* s_new) const;
  /// Which smooth piece of its law each point is on, [num_points], as numbered by kernels().regime_names;
  /// empty when the law is smooth everywhere.
  std::vector<signed char> regimes(const StepInfo& step, const TermStepData& data, const VectorXd& u) const;
  /// Energies over a converged step that led from (u_old, s_old) to (u, s_new).
  TermEnergies energies(const StepInfo& step, const TermStepData& data, const VectorXd& native,
                        const VectorXd& u_old, const double* s_old, const VectorXd& u,
                        const double* s_new) const;
  /// Energy [mJ] stored at the end of a step that led to u and the history slice s, all parts of the law.
  /// Unless u_bar is null: adds its derivatives by displacement, history slice and native parameters.
  double stored(const StepInfo& step, const TermStepData& data, const VectorXd& u, const double* s,
                VectorXd* u_bar = nullptr, double* s_bar = nullptr, VectorXd* native_bar = nullptr) const;
  /// Largest s ≤ 1 with det(F + s dF) > 0 everywhere; +inf when the whole step is free.
  double feasible_step(const VectorXd& u, const VectorXd& d) const;
  /// Smallest J = det F over the points (prisms; +inf for surface terms).
  double smallest_jacobian(const VectorXd& u) const;

  /// Tangent blocks along `count` ≤ kDirections directions; see PointKernel::tangent. Direction-major
  /// columns: du, du_old, df [num_nodes·3][kDirections], ds_old, ds_new [history][kDirections] row-major,
  /// dnative one per direction.
  struct Directions {
    int count = 0;
    const double* du = nullptr;
    const double* du_old = nullptr;
    const double* ds_old = nullptr;
    std::vector<const VectorXd*> dnative;
  };
  void tangent(const StepInfo& step, const TermStepData& data, const VectorXd& u, const VectorXd& u_old,
               const double* s_old, const Directions& directions, double* df, double* ds_new) const;
  /// Adds (∂s_new/∂u)ᵀ s_bar to u_bar.
  void adjoint_update(const StepInfo& step, const TermStepData& data, const VectorXd& u, const double* s_bar,
                      VectorXd& u_bar) const;
  /// Transposed cross blocks of −adjᵀR + s_barᵀ s_new; see PointKernel::adjoint_step.
  void adjoint_step(const StepInfo& step, const TermStepData& data, const VectorXd& u, const VectorXd& u_old,
                    const double* s_old, const VectorXd& adj, const double* s_bar, VectorXd& u_old_bar,
                    double* s_old_bar, VectorXd& native_bar) const;

  const TermCounters& counters() const { return counters_; }

 private:
  double ahead(const VectorXd& native) const { return clock_ >= 0 ? native[clock_] : 0; }
  std::vector<std::vector<double>> map_theta(const StepInfo& step, const VectorXd& native, double ahead,
                                             double fixed_scale) const;
  /// TermStepData::rates; empty without a clock.
  std::vector<std::vector<double>> path_rates(const StepInfo& step, const VectorXd& native) const;

  std::string name_;
  const KernelTable* kernels_;
  std::shared_ptr<const void> law_;
  std::vector<TermGroup> groups_;
  int num_points_ = 0, clock_ = -1;
  mutable TermCounters counters_;
};

}  // namespace rhytid
