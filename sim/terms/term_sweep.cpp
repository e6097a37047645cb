// A term in a sweep: tangent and adjoint blocks of a converged step.
#include <algorithm>
#include <array>
#include <optional>

#include "sim/terms/element_loop.h"

namespace rhytid {

void Term::tangent(const StepInfo& step, const TermStepData& data, const VectorXd& u, const VectorXd& u_old,
                   const double* s_old, const Directions& dir, double* df, double* ds_new) const {
  constexpr int D = kDirections;
  using ElementDirections = std::array<double, std::size_t{3} * D * kMaxElementNodes>;
  const int nt = kernels_->ntheta, ns = kernels_->ns;
  if (!df && (ns == 0 || !ds_new)) return;
  ++counters_.tangent;
  std::vector<std::vector<std::vector<double>>> dtheta;  // per direction, per group
  for (const VectorXd* direction : dir.dnative)
    dtheta.push_back(load_theta_direction(step, data, *direction));
  // Parameter directions at the points of an element, [nq][nt][D]; empty without any.
  const auto element_dtheta = [&](std::size_t gi, int element) {
    const int nq = groups_[gi].num_points;
    std::vector<double> dth;
    if (dtheta.empty()) return dth;
    dth.assign(static_cast<std::size_t>(nq) * nt * D, 0.0);
    for (std::size_t k = 0; k < dtheta.size(); ++k) {
      const auto& values = dtheta[k][gi];
      const bool per_point = values.size() > static_cast<std::size_t>(nt);
      const std::size_t first = static_cast<std::size_t>(element) * nq;
      for (int q = 0; q < nq; ++q)
        for (int s = 0; s < nt; ++s)
          dth[(static_cast<std::size_t>(q) * nt + s) * D + k] = values[per_point ? (first + q) * nt + s : s];
    }
    return dth;
  };
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    std::optional<ElementVectors> forces;
    if (df) forces.emplace(g, 3 * D);
    // What elements share is spread over the points once.
    const bool by_point = std::any_of(dtheta.begin(), dtheta.end(), [&](const auto& direction) {
      return direction[gi].size() > static_cast<std::size_t>(nt);
    });
    const std::vector<double> shared = by_point ? std::vector<double>() : element_dtheta(gi, 0);
    for_elements(*this, gi, step, data, [&](const TermElement& e) {
      ElementDirections du, du_old;  // not set to zero: only what belongs to the element's nodes is read
      if (dir.du) e.gather(dir.du, 3 * D, du.data());
      if (dir.du_old) e.gather(dir.du_old, 3 * D, du_old.data());
      const std::vector<double> own = by_point ? element_dtheta(gi, e.index) : std::vector<double>();
      const std::vector<double>& dth = by_point ? own : shared;
      kernels_->tangent(law_.get(), e.view, e.gather(u).data(), e.gather(u_old).data(),
                        s_old ? s_old + e.point * ns : nullptr, data.prepared.data() + e.point * kernels_->np,
                        dir.du ? du.data() : nullptr, dir.du_old ? du_old.data() : nullptr,
                        dir.ds_old ? dir.ds_old + e.point * ns * D : nullptr,
                        dth.empty() ? nullptr : dth.data(), df ? forces->of(e) : nullptr,
                        ds_new ? ds_new + e.point * ns * D : nullptr);
    });
    if (df) forces->add_to(df);
  }
}

void Term::adjoint_update(const StepInfo& step, const TermStepData& data, const VectorXd& u,
                          const double* s_bar, VectorXd& u_bar) const {
  if (kernels_->ns == 0) return;
  ++counters_.adjoint;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    ElementVectors bars(groups_[gi], 3);
    for_elements(*this, gi, step, data, [&](const TermElement& e) {
      kernels_->adjoint_update(law_.get(), e.view, e.gather(u).data(),
                               data.prepared.data() + e.point * kernels_->np, s_bar + e.point * kernels_->ns,
                               bars.of(e));
    });
    bars.add_to(u_bar.data());
  }
}

void Term::adjoint_step(const StepInfo& step, const TermStepData& data, const VectorXd& u,
                        const VectorXd& u_old, const double* s_old, const VectorXd& adj, const double* s_bar,
                        VectorXd& u_old_bar, double* s_old_bar, VectorXd& native_bar) const {
  ++counters_.adjoint;
  const int nt = kernels_->ntheta, ns = kernels_->ns;
  std::vector<double> theta_bar(static_cast<std::size_t>(num_points_) * nt, 0.0);
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    ElementVectors bars(groups_[gi], 3);
    for_elements(*this, gi, step, data, [&](const TermElement& e) {
      kernels_->adjoint_step(law_.get(), e.view, e.gather(u).data(), e.gather(u_old).data(),
                             s_old ? s_old + e.point * ns : nullptr,
                             data.prepared.data() + e.point * kernels_->np, e.gather(adj).data(),
                             s_bar ? s_bar + e.point * ns : nullptr, bars.of(e),
                             s_old_bar ? s_old_bar + e.point * ns : nullptr, theta_bar.data() + e.point * nt);
    });
    if (kernels_->np > 0) bars.add_to(u_old_bar.data());
  }
  add_theta_transpose(step, data, theta_bar, native_bar);
}

double Term::stored(const StepInfo& step, const TermStepData& data, const VectorXd& u, const double* s,
                    VectorXd* u_bar, double* s_bar, VectorXd* native_bar) const {
  if (kernels_->num_stored == 0) return 0;
  ++(u_bar ? counters_.adjoint : counters_.energy);
  const std::size_t points = static_cast<std::size_t>(num_points_);
  std::vector<double> ds(u_bar ? points * kernels_->ns : 0), dtheta(u_bar ? points * kernels_->ntheta : 0);
  double total = 0;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    std::vector<double> energies(groups_[gi].num_elements);
    std::optional<ElementVectors> forces;
    if (u_bar) forces.emplace(groups_[gi], 3);
    for_elements(*this, gi, step, data, [&](const TermElement& e) {
      energies[e.index] =
          kernels_->stored(law_.get(), e.view, e.gather(u).data(), s + e.point * kernels_->ns,
                           forces ? forces->of(e) : nullptr, ds.data() + e.point * kernels_->ns,
                           dtheta.data() + e.point * kernels_->ntheta);
    });
    for (const double energy : energies) total += energy;
    if (u_bar) forces->add_to(u_bar->data());
  }
  if (u_bar) {
    for (std::size_t k = 0; k < ds.size(); ++k) s_bar[k] += ds[k];
    add_theta_transpose(step, data, dtheta, *native_bar);
  }
  return total;
}

}  // namespace rhytid
