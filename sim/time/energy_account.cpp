#include "sim/time/energy_account.h"

namespace rhytid {

EnergyAccount account_step(const StepProblem& problem, const State& end) {
  const Model& model = problem.model();
  const State& old = problem.old();
  EnergyAccount account;
  for (std::size_t k = 0; k < model.terms.size(); ++k) {
    const Term& term = model.terms[k];
    const std::size_t at = model.history_offset(k);
    const TermEnergies e = term.energies(problem.step(), problem.data(k), problem.native(), old.u,
                                         old.history.data() + at, end.u, end.history.data() + at);
    TermAccount one;
    one.term = term.name();
    for (int part = 0; part < term.kernels().num_stored; ++part) {
      one.stored.push_back({term.kernels().stored_names[part], e.stored[part]});
      one.stored_change += e.stored[part] - e.stored_before[part];
      account.stored += e.stored[part];
    }
    one.work = e.body_work;
    one.dissipated = e.dissipated;
    one.numerical = e.force_work - one.stored_change - one.dissipated + one.work;
    account.stored_change += one.stored_change;
    account.work += one.work;
    account.dissipated += one.dissipated;
    account.numerical += one.numerical;
    account.terms.push_back(std::move(one));
  }
  // R · Δu over all components is the rim's work and, at free ones, the residual's.
  const VectorXd du = end.u - old.u, residual = problem.residual(end.u);
  account.rim_work = residual.dot(du) - model.to_unknowns(residual).dot(model.to_unknowns(du));
  account.imbalance =
      account.stored_change - account.work - account.rim_work + account.dissipated + account.numerical;
  return account;
}

}  // namespace rhytid
