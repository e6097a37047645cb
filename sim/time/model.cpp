#include "sim/time/model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "sim/core/error.h"

namespace rhytid {

void Model::finish() {
  history_offsets_.clear();
  history_size_ = 0;
  std::map<std::vector<int>, int> known;
  std::vector<std::vector<int>> cliques;
  for (Term& term : terms) {
    history_offsets_.push_back(history_size_);
    history_size_ += term.history_size();
    for (TermGroup& g : term.groups()) {
      g.cliques.resize(g.num_elements);
      for (int e = 0; e < g.num_elements; ++e) {
        std::vector<int> blocks(g.num_nodes);
        for (int i = 0; i < g.num_nodes; ++i)
          blocks[i] = constraints.block[g.nodes[static_cast<std::size_t>(e) * g.num_nodes + i]];
        const auto [it, fresh] = known.try_emplace(blocks, static_cast<int>(cliques.size()));
        if (fresh) cliques.push_back(blocks);
        g.cliques[e] = it->second;
      }
    }
  }
  // Faces whose nodes are all fixed give all −1 cliques; several of them share one key, which is harmless.
  pattern_ =
      std::make_shared<BlockPattern>(static_cast<int>(constraints.block_nodes.size()), std::move(cliques));
}

State Model::rest_state() const {
  return {0, VectorXd::Zero(3 * num_nodes()), VectorXd::Zero(static_cast<Eigen::Index>(history_size_)), {}};
}

VectorXd Model::given_displacement(double t) const {
  if (constraints.moved.empty()) return {};
  VectorXd u = VectorXd::Zero(3 * num_nodes());
  for (const MovedNodes& part : constraints.moved) {
    Vec3 displacement = Vec3::Zero();
    for (const KnotWeight& w : part.path.weights(t)) displacement += w.weight * part.displacements[w.knot];
    for (const int node : part.nodes) u.segment<3>(3 * node) = displacement;
  }
  return u;
}

VectorXd Model::given_velocity(double t) const {
  if (constraints.moved.empty()) return {};
  VectorXd v = VectorXd::Zero(3 * num_nodes());
  for (const MovedNodes& part : constraints.moved) {
    Vec3 velocity = Vec3::Zero();
    for (const KnotWeight& w : part.path.rates(t)) velocity += w.weight * part.displacements[w.knot];
    for (const int node : part.nodes) v.segment<3>(3 * node) = velocity;
  }
  return v;
}

bool Model::clock_meets_kink(const VectorXd& values, const std::vector<double>& times, double room) const {
  // `value` of a knot: one component of its place.
  const auto has_kink_at_steps = [&](const KnotPath& path, auto value) {
    for (const double knot : path.times()) {
      const auto meets = [&](double t) { return std::fabs(t + ahead(values) - knot) <= room; };
      if (std::none_of(times.begin(), times.end(), meets)) continue;
      double jump = 0, speed = 0;
      for (const bool after : {false, true})
        for (const KnotWeight& w : path.rates(knot, after ? KnotPath::Side::after : KnotPath::Side::before)) {
          jump += (after ? 1 : -1) * w.weight * value(w.knot);
          speed += std::fabs(w.weight * value(w.knot));
        }
      if (std::fabs(jump) > 1e-9 * speed) return true;
    }
    return false;
  };
  for (const Term& term : terms)
    for (const TermGroup& group : term.groups())
      for (const ThetaSlot& slot : group.theta)
        if (slot.path &&
            has_kink_at_steps(*slot.path, [&](int k) { return values[slot.offset + slot.stride * k]; }))
          return true;
  for (const MovedNodes& part : constraints.moved)
    for (int axis = 0; axis < 3; ++axis)
      if (has_kink_at_steps(part.path,
                            [&](int k) { return part.displacements[static_cast<std::size_t>(k)][axis]; }))
        return true;
  return false;
}

std::vector<int> Model::penalties() const {
  std::vector<int> indices;
  for (const NativeBlock& block : native_blocks)
    if (block.name == "base" || block.name.rfind("collider/", 0) == 0)
      indices.insert(indices.end(), block.stiffness_like.begin(), block.stiffness_like.end());
  return indices;
}

const NativeBlock& Model::native_block(const std::string& name) const {
  for (const NativeBlock& block : native_blocks)
    if (block.name == name) return block;
  throw ContractError("no native parameter block '" + name + "'");
}

MatrixXd Model::to_unknowns(const MatrixXd& u) const {
  const auto& c = constraints;
  MatrixXd q(3 * c.block_nodes.size(), u.cols());
  for (std::size_t b = 0; b < c.block_nodes.size(); ++b) {
    const auto rows = u.middleRows(3 * c.block_nodes[b], 3);
    if (c.frame_of_block[b] < 0) {
      q.middleRows(3 * b, 3) = rows;
    } else {
      q.middleRows(3 * b, 3) = c.frames[c.frame_of_block[b]].transpose() * rows;
    }
  }
  for (int i : c.fixed_unknowns) q.row(i).setZero();
  return q;
}

MatrixXd Model::to_displacement(const MatrixXd& q) const {
  const auto& c = constraints;
  MatrixXd u = MatrixXd::Zero(3 * num_nodes(), q.cols());
  for (std::size_t b = 0; b < c.block_nodes.size(); ++b) {
    const auto rows = q.middleRows(3 * b, 3);
    if (c.frame_of_block[b] < 0) {
      u.middleRows(3 * c.block_nodes[b], 3) = rows;
    } else {
      u.middleRows(3 * c.block_nodes[b], 3) = c.frames[c.frame_of_block[b]] * rows;
    }
  }
  return u;
}

VectorXd Model::to_unknowns(const VectorXd& u) const {
  return to_unknowns(MatrixXd(u)).col(0);
}
VectorXd Model::to_displacement(const VectorXd& q) const {
  return to_displacement(MatrixXd(q)).col(0);
}

StepProblem::StepProblem(const Model& model, const VectorXd& native, const StepInfo& step, const State& old)
    : model_(&model),
      native_(&native),
      step_(step),
      old_(&old),
      data_(model.terms.size()),
      given_(model.given_displacement(step.t + model.ahead(native))) {
  require(step.dt() > 0, "StepProblem: the step's dt must be positive");
  for (std::size_t k = 0; k < model.terms.size(); ++k)
    model.terms[k].prepare(step_, native, old.u, old.history.data() + model.history_offset(k), data_[k]);
}

VectorXd StepProblem::displacement(const VectorXd& q) const {
  VectorXd u = model_->to_displacement(q);
  if (given_.size() > 0) u += given_;
  return u;
}

VectorXd StepProblem::given_by_clock() const {
  if (model_->clock < 0) return {};
  VectorXd velocity = model_->given_velocity(step_.t + model_->ahead(*native_));
  if (velocity.size() > 0 && velocity.isZero(0)) return {};
  return velocity;
}

double StepProblem::energy(const VectorXd& q, VectorXd* gradient) {
  return energy_at(displacement(q), gradient);
}

double StepProblem::energy_at(const VectorXd& u, VectorXd* gradient) {
  VectorXd g, absolute;
  if (gradient) g = absolute = VectorXd::Zero(u.size());
  double total = 0;
  for (std::size_t k = 0; k < data_.size(); ++k) {
    total +=
        model_->terms[k].energy(step_, data_[k], u, gradient ? &g : nullptr, gradient ? &absolute : nullptr);
    if (!std::isfinite(total)) return std::numeric_limits<double>::infinity();
  }
  if (gradient) {
    *gradient = model_->to_unknowns(g);
    force_scale_ = absolute.norm();
  }
  return total;
}

VectorXd StepProblem::residual(const VectorXd& u) const {
  VectorXd g = VectorXd::Zero(u.size());
  for (std::size_t k = 0; k < data_.size(); ++k) {
    const double energy = model_->terms[k].energy(step_, data_[k], u, &g, nullptr);
    if (!std::isfinite(energy))
      throw ContractError("StepProblem::residual: outside the domain of the term '" +
                          model_->terms[k].name() + "'");
  }
  return g;
}

std::vector<double> StepProblem::term_energies(const VectorXd& u) const {
  std::vector<double> energies;
  for (std::size_t k = 0; k < data_.size(); ++k)
    energies.push_back(model_->terms[k].energy(step_, data_[k], u, nullptr, nullptr));
  return energies;
}

namespace {

/// Rotates framed nodes' rows and columns, then adds to the block matrix.
class FramedSink final : public Term::MatrixSink {
 public:
  FramedSink(const Constraints& constraints, BlockMatrix& out) : constraints_(constraints), out_(out) {}
  void add(const TermGroup& g, int element, double* dense) override {
    if (!constraints_.frames.empty()) rotate(g, element, dense);
    out_.add(g.cliques[element], dense);
  }

 private:
  void rotate(const TermGroup& g, int element, double* dense) {
    const int n3 = 3 * g.num_nodes;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> k(dense, n3, n3);
    for (int i = 0; i < g.num_nodes; ++i) {
      const int block = constraints_.block[g.nodes[static_cast<std::size_t>(element) * g.num_nodes + i]];
      if (block < 0 || constraints_.frame_of_block[block] < 0) continue;
      const Mat3& frame = constraints_.frames[constraints_.frame_of_block[block]];
      k.middleRows(3 * i, 3) = (frame.transpose() * k.middleRows(3 * i, 3)).eval();
      k.middleCols(3 * i, 3) = (k.middleCols(3 * i, 3) * frame).eval();
    }
  }
  const Constraints& constraints_;
  BlockMatrix& out_;
};

}  // namespace

void StepProblem::hessian(const VectorXd& q, Curvature curvature, BlockMatrix& out) {
  hessian_at(displacement(q), curvature, out);
}

void StepProblem::hessian_at(const VectorXd& u, Curvature curvature, BlockMatrix& out) {
  out.set_zero();
  FramedSink sink(model_->constraints, out);
  for (std::size_t k = 0; k < data_.size(); ++k)
    model_->terms[k].hessian(step_, data_[k], u, curvature == Curvature::projected, sink);
  for (int i : model_->constraints.fixed_unknowns) out.fix(i);
}

VectorXd StepProblem::hessian_times(const VectorXd& u, const VectorXd& v) const {
  struct Product : Term::MatrixSink {
    const VectorXd& v;
    VectorXd result;
    explicit Product(const VectorXd& vector) : v(vector), result(VectorXd::Zero(vector.size())) {}
    void add(const TermGroup& group, int element, double* dense) override {
      const int n = group.num_nodes, *nodes = group.nodes.data() + static_cast<std::size_t>(element) * n;
      VectorXd local(3 * n);
      for (int i = 0; i < n; ++i) local.segment<3>(3 * i) = v.segment<3>(3 * nodes[i]);
      if (local.isZero(0)) return;
      const VectorXd product = Eigen::Map<const MatrixXd>(dense, 3 * n, 3 * n) * local;  // symmetric
      for (int i = 0; i < n; ++i) result.segment<3>(3 * nodes[i]) += product.segment<3>(3 * i);
    }
  } sink(v);
  for (std::size_t k = 0; k < data_.size(); ++k) model_->terms[k].hessian(step_, data_[k], u, false, sink);
  return sink.result;
}

VectorXd StepProblem::first_guess(MinimiserReport& work) {
  const VectorXd held = model_->to_unknowns(old_->u);
  if (old_->velocity.size() == 0) return held;
  VectorXd moved = held + step_.dt() * model_->to_unknowns(old_->velocity);
  work.evaluations += 2;
  return energy(moved, nullptr) < energy(held, nullptr) ? moved : held;
}

VectorXd StepProblem::response_to_given_motion(CholeskyFactor& factor, BlockMatrix& matrix,
                                               MinimiserReport& work) {
  // Far below every thickness, so that the difference of forces is linear; far above rounding.
  constexpr double kSmallMotion = 1e-4;  // mm
  if (given_.size() == 0) return {};
  VectorXd motion = given_;
  for (const MovedNodes& part : model_->constraints.moved)
    for (const int node : part.nodes) motion.segment<3>(3 * node) -= old_->u.segment<3>(3 * node);
  const double largest = motion.cwiseAbs().maxCoeff();
  if (largest == 0) return {};
  const double scale = std::min(1., kSmallMotion / largest);
  VectorXd ahead, behind;
  work.evaluations += 2;
  if (!std::isfinite(energy_at(old_->u + scale * motion, &ahead)) ||
      !std::isfinite(energy_at(old_->u - scale * motion, &behind)))
    return {};
  hessian_at(old_->u, Curvature::projected, matrix);
  ++work.factorisations;
  if (!factor.factorize(matrix)) {
    ++work.failed_factorisations;
    return {};
  }
  const VectorXd forces = (ahead - behind) / (2 * scale);
  return model_->to_unknowns(old_->u) - VectorXd(factor.solve(forces));
}

double StepProblem::largest_feasible_step(const VectorXd& q, const VectorXd& d) {
  const VectorXd u = displacement(q), du = model_->to_displacement(d);
  double smallest = std::numeric_limits<double>::infinity();
  for (const Term& term : model_->terms) smallest = std::min(smallest, term.feasible_step(u, du));
  return smallest;
}

State StepProblem::relagged(const VectorXd& u) const {
  State next = *old_;
  for (std::size_t k = 0; k < data_.size(); ++k)
    if (model_->terms[k].kernels().history_is_lag)
      model_->terms[k].update(step_, data_[k], u, next.history.data() + model_->history_offset(k));
  return next;
}

State StepProblem::advance(const VectorXd& u) const {
  State next{step_.t, u, VectorXd::Zero(static_cast<Eigen::Index>(model_->history_size())),
             (u - old_->u) / step_.dt()};
  for (std::size_t k = 0; k < data_.size(); ++k)
    model_->terms[k].update(step_, data_[k], u, next.history.data() + model_->history_offset(k));
  return next;
}

}  // namespace rhytid
