#include "adjoint/stored_energy.h"

#include <algorithm>

#include "sim/core/error.h"

namespace rhytid::adjoint {
namespace {

struct Gradient {
  VectorXd u, s, native;
};

Gradient gradient(const StepProblem& step, const State& state, const std::vector<std::size_t>& terms) {
  Gradient g{VectorXd::Zero(state.u.size()), VectorXd::Zero(state.history.size()),
             VectorXd::Zero(step.native().size())};
  for (const std::size_t t : terms) {
    const std::size_t at = step.model().history_offset(t);
    (void)step.model().terms[t].stored(step.step(), step.data(t), state.u, state.history.data() + at, &g.u,
                                       g.s.data() + at, &g.native);
  }
  return g;
}

}  // namespace

StoredEnergy::StoredEnergy(const Model& model, const std::vector<std::string>& terms, int first_frame)
    : first_frame_(first_frame) {
  for (std::size_t t = 0; t < model.terms.size(); ++t)
    if (terms.empty() || std::find(terms.begin(), terms.end(), model.terms[t].name()) != terms.end())
      terms_.push_back(t);
  for (const std::string& name : terms)
    if (std::none_of(model.terms.begin(), model.terms.end(),
                     [&](const Term& term) { return term.name() == name; }))
      throw ContractError("StoredEnergy: no term is called " + name);
}

VectorXd StoredEnergy::step_values(int frame, const StepProblem& step, const State& state) const {
  VectorXd out = VectorXd::Zero(size(frame));
  if (out.size() == 0) return out;
  for (const std::size_t t : terms_)
    out[0] += step.model().terms[t].stored(step.step(), step.data(t), state.u,
                                           state.history.data() + step.model().history_offset(t));
  return out;
}

MatrixXd StoredEnergy::step_tangent(int frame, const StepProblem& step, const State& state,
                                    const StepDirections& d) const {
  if (size(frame) == 0) return MatrixXd(0, d.du.cols());
  const Gradient g = gradient(step, state, terms_);
  return g.u.transpose() * d.du + g.s.transpose() * d.ds + g.native.transpose() * d.dnative;
}

void StoredEnergy::step_adjoint(int frame, const StepProblem& step, const State& state,
                                const VectorXd& weights, StepBars& bars) const {
  if (size(frame) == 0) return;
  const Gradient g = gradient(step, state, terms_);
  bars.u += weights[0] * g.u;
  bars.s += weights[0] * g.s;
  bars.native += weights[0] * g.native;
}

}  // namespace rhytid::adjoint
