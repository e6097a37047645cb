#include "adjoint/resultant_force.h"

#include <algorithm>

#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

constexpr int D = kDirections;
using Block = Eigen::Matrix<double, Eigen::Dynamic, D, Eigen::RowMajor>;
using Resultant = Eigen::Matrix<double, Eigen::Dynamic, 3>;

std::size_t index_of(const Model& model, const std::string& name) {
  const auto it = std::find_if(model.terms.begin(), model.terms.end(),
                               [&](const Term& term) { return term.name() == name; });
  if (it == model.terms.end()) throw ContractError("ResultantForce: no term is called " + name);
  return static_cast<std::size_t>(it - model.terms.begin());
}

/// Hessian times the three translations, [num_nodes·3][3], element by element.
class TranslationProduct final : public Term::MatrixSink {
 public:
  explicit TranslationProduct(Eigen::Index rows) : product_(Resultant::Zero(rows, 3)) {}
  void add(const TermGroup& group, int element, double* dense) override {
    const int n = group.num_nodes;
    const int* nodes = group.nodes.data() + static_cast<std::size_t>(element) * n;
    for (int i = 0; i < 3 * n; ++i)
      for (int j = 0; j < 3 * n; ++j) product_(3 * nodes[i / 3] + i % 3, j % 3) += dense[3 * n * i + j];
  }
  const Resultant& product() const { return product_; }

 private:
  Resultant product_;
};

Resultant force_by_displacement(const StepProblem& step, const State& state,
                                const std::vector<std::size_t>& terms) {
  TranslationProduct sum(state.u.size());
  for (const std::size_t t : terms)
    step.model().terms[t].hessian(step.step(), step.data(t), state.u, false, sum);
  return sum.product();
}

/// Sum over the nodes, [3][k] of [num_nodes·3][k].
MatrixXd summed(const MatrixXd& nodal) {
  MatrixXd sum = MatrixXd::Zero(3, nodal.cols());
  for (Eigen::Index i = 0; i < nodal.rows(); ++i) sum.row(i % 3) += nodal.row(i);
  return sum;
}

}  // namespace

ResultantForce::ResultantForce(const Model& model, const std::vector<std::string>& terms, int first_frame)
    : first_frame_(first_frame) {
  for (const std::string& name : terms) terms_.push_back(index_of(model, name));
}

VectorXd ResultantForce::step_values(int frame, const StepProblem& step, const State& state) const {
  if (size(frame) == 0) return {};
  VectorXd forces = VectorXd::Zero(state.u.size());
  for (const std::size_t t : terms_)
    (void)step.model().terms[t].energy(step.step(), step.data(t), state.u, &forces, nullptr);
  return summed(forces);
}

MatrixXd ResultantForce::step_tangent(int frame, const StepProblem& step, const State& state,
                                      const StepDirections& d) const {
  const Eigen::Index count = d.du.cols();
  if (size(frame) == 0) return MatrixXd(0, count);
  MatrixXd out = force_by_displacement(step, state, terms_).transpose() * d.du;
  for (Eigen::Index first = 0; first < count; first += D) {
    const Eigen::Index width = std::min<Eigen::Index>(D, count - first);
    Block du_old = Block::Zero(d.du_old.rows(), D), ds_old = Block::Zero(d.ds_old.rows(), D),
          df = Block::Zero(d.du.rows(), D);
    du_old.leftCols(width) = d.du_old.middleCols(first, width);
    ds_old.leftCols(width) = d.ds_old.middleCols(first, width);
    std::vector<VectorXd> columns;
    for (Eigen::Index k = 0; k < width; ++k) columns.push_back(d.dnative.col(first + k));
    Term::Directions along;
    along.count = static_cast<int>(width);
    along.du_old = du_old.data();
    for (const VectorXd& column : columns) along.dnative.push_back(&column);
    for (const std::size_t t : terms_) {
      const std::size_t at = step.model().history_offset(t);
      along.ds_old = ds_old.data() + at * D;
      step.model().terms[t].tangent(step.step(), step.data(t), state.u, step.old().u,
                                    step.old().history.data() + at, along, df.data(), nullptr);
    }
    out.middleCols(first, width) += summed(df.leftCols(width));
  }
  return out;
}

void ResultantForce::step_adjoint(int frame, const StepProblem& step, const State& state,
                                  const VectorXd& weights, StepBars& bars) const {
  if (size(frame) == 0) return;
  bars.u += force_by_displacement(step, state, terms_) * weights;
  // The blocks transpose −adjᵀ R: minus the translation that the weights are.
  const VectorXd adj = -weights.replicate(state.u.size() / 3, 1);
  for (const std::size_t t : terms_) {
    const Term& term = step.model().terms[t];
    const auto at = static_cast<Eigen::Index>(step.model().history_offset(t)),
               count = static_cast<Eigen::Index>(term.history_size());
    const VectorXd s_bar = VectorXd::Zero(count);
    VectorXd s_old = VectorXd::Zero(count);
    term.adjoint_step(step.step(), step.data(t), state.u, step.old().u, step.old().history.data() + at, adj,
                      s_bar.data(), bars.u_old, s_old.data(), bars.native);
    bars.s_old.segment(at, count) += s_old;
  }
}

ResultantForce collider_force(const Model& model, const std::string& name, int first_frame) {
  std::vector<std::string> terms{"contact " + name};
  for (const Term& term : model.terms)
    if (term.name() == "friction " + name) terms.push_back(term.name());
  return {model, terms, first_frame};
}

}  // namespace rhytid::adjoint
