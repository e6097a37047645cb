// A term within a step: energy, gradient, Hessian, history and what limits the step.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "sim/core/parallel.h"
#include "sim/math/cubic.h"
#include "sim/terms/element_loop.h"
#include "sim/terms/kinematics.h"

namespace rhytid {

void Term::prepare(const StepInfo& step, const VectorXd& native, const VectorXd& u_old, const double* s_old,
                   TermStepData& data) const {
  ++counters_.prepare;
  data.theta = load_theta(step, native);
  data.ahead = ahead(native);
  data.rates = path_rates(step, native);
  if (kernels_->np == 0) return;
  data.prepared.resize(static_cast<std::size_t>(num_points_) * kernels_->np);
  for_elements(*this, step, data, [&](const TermElement& e) {
    kernels_->prepare(law_.get(), e.view, e.gather(u_old).data(), s_old + e.point * kernels_->ns,
                      data.prepared.data() + e.point * kernels_->np);
  });
}

double Term::energy(const StepInfo& step, const TermStepData& data, const VectorXd& u, VectorXd* gradient,
                    VectorXd* absolute) const {
  ++(gradient ? counters_.gradient : counters_.energy);
  double total = 0;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    std::vector<double> energies(g.num_elements);
    std::optional<ElementVectors> forces;
    if (gradient) forces.emplace(g, 3);
    for_elements(*this, gi, step, data, [&](const TermElement& e) {
      energies[e.index] =
          kernels_->energy(law_.get(), e.view, e.gather(u).data(),
                           data.prepared.data() + e.point * kernels_->np, forces ? forces->of(e) : nullptr);
    });
    for (double w : energies) total += w;
    if (!std::isfinite(total)) return std::numeric_limits<double>::infinity();
    if (gradient) forces->add_to(gradient->data());
    if (gradient && absolute) forces->add_absolute_to(absolute->data());
  }
  return total;
}

void Term::hessian(const StepInfo& step, const TermStepData& data, const VectorXd& u, bool projected,
                   MatrixSink& sink) const {
  ++counters_.hessian;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    const std::size_t size = static_cast<std::size_t>(3 * g.num_nodes) * (3 * g.num_nodes);
    const std::size_t work_size = hessian_work_size(g.padded_nodes, g.product.view());
    // While elements of one chunk are computed, one thread adds those of the chunk before, in order. One thread alone
    // takes few: a fifth of its time goes into matrices that leave its cache. Several gain nothing from that, and wait
    // for each other at every chunk.
    const int chunk = std::min(num_threads() == 1 ? 4 : 32, g.num_elements);
    struct Chunk {
      int first = 0, count = 0;
      std::vector<double> dense;
      std::vector<char> present;
    };
    // Kept for the next call: fresh pages cost a tenth of the elements.
    thread_local Chunk kept[2];
    Chunk* const chunks = kept;             // of this thread, for all that work on it
    chunks[0].count = chunks[1].count = 0;  // what an earlier call left is not added again
    for (int turn = 0; turn < (g.num_elements > chunk ? 2 : 1); ++turn) {
      const std::size_t needed = size * static_cast<std::size_t>(chunk);
      if (chunks[turn].dense.size() < needed) chunks[turn].dense.resize(needed);
      chunks[turn].present.resize(static_cast<std::size_t>(chunk));
    }
    const auto add = [&](Chunk& c) {
      for (int k = 0; k < c.count; ++k)
        if (c.present[k]) sink.add(g, c.first + k, c.dense.data() + size * k);
    };
    for (int first = 0, turn = 0; first < g.num_elements; first += chunk, turn = 1 - turn) {
      Chunk &now = chunks[turn], &before = chunks[1 - turn];
      now.first = first;
      now.count = std::min(chunk, g.num_elements - first);
      parallel_for_uneven(now.count + 1, [&](std::int64_t i) {
        if (i == 0) return add(before);
        const int k = static_cast<int>(i) - 1;
        const TermElement e = term_element(*kernels_, g, first + k, step.dt(), data.theta[gi]);
        thread_local std::vector<double> work;
        if (work.size() < work_size) work.resize(work_size);
        now.present[k] = kernels_->hessian(law_.get(), e.view, e.gather(u).data(),
                                           data.prepared.data() + e.point * kernels_->np, projected,
                                           work.data(), now.dense.data() + size * k);
      });
      before.count = 0;
      if (first + chunk >= g.num_elements) add(now);
    }
  }
}

void Term::update(const StepInfo& step, const TermStepData& data, const VectorXd& u, double* s_new) const {
  if (kernels_->ns == 0) return;
  ++counters_.update;
  for_elements(*this, step, data, [&](const TermElement& e) {
    kernels_->update(law_.get(), e.view, e.gather(u).data(), data.prepared.data() + e.point * kernels_->np,
                     s_new + e.point * kernels_->ns);
  });
}

TermEnergies Term::energies(const StepInfo& step, const TermStepData& data, const VectorXd& native,
                            const VectorXd& u_old, const double* s_old, const VectorXd& u,
                            const double* s_new) const {
  const StepInfo before{step.index, step.t_old, step.t_old};
  const std::vector<std::vector<double>> theta_old = load_theta(before, native);
  TermEnergies total;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    std::vector<TermEnergies> sums(groups_[gi].num_elements);
    for_elements(*this, gi, step, data, [&](const TermElement& e) {
      const TermElement old = term_element(*kernels_, groups_[gi], e.index, step.dt(), theta_old[gi]);
      kernels_->account(law_.get(), e.view, old.view.theta, e.gather(u_old).data(),
                        s_old + e.point * kernels_->ns, e.gather(u).data(),
                        data.prepared.data() + e.point * kernels_->np, s_new + e.point * kernels_->ns,
                        &sums[e.index]);
    });
    for (const TermEnergies& one : sums) total.add(one);
  }
  return total;
}

std::vector<signed char> Term::regimes(const StepInfo& step, const TermStepData& data,
                                       const VectorXd& u) const {
  if (!kernels_->regime) return {};
  std::vector<signed char> result(num_points_);
  for_elements(*this, step, data, [&](const TermElement& e) {
    kernels_->regime(law_.get(), e.view, e.gather(u).data(), data.prepared.data() + e.point * kernels_->np,
                     result.data() + e.point);
  });
  return result;
}

namespace {

/// Displacement gradient H of an element at point q, row-major.
void displacement_gradient(const TermGroup& g, int element, int q, const double* local, double* h) {
  const double* ji = g.inverse_jacobian.data() + (static_cast<std::size_t>(element) * g.num_points + q) * 9;
  double natural[9] = {};
  for (int r = 0; r < 3; ++r) {
    const double* t = g.node_by_row.data() + static_cast<std::size_t>(3 * q + r) * g.padded_nodes;
    for (int i = 0; i < g.num_nodes; ++i)
      for (int a = 0; a < 3; ++a) natural[3 * a + r] += local[3 * i + a] * t[i];
  }
  PrismKinematics::to_point(natural, ji, h);
}

}  // namespace

double Term::feasible_step(const VectorXd& u, const VectorXd& d) const {
  const double unlimited = std::numeric_limits<double>::infinity();
  if (kernels_->rows != 3) return unlimited;
  double smallest = unlimited;
  const std::vector<double> no_theta;
  for (const TermGroup& g : groups_) {
    std::vector<double> steps(g.num_elements, unlimited);
    parallel_for(g.num_elements, [&](std::int64_t k) {
      const int e = static_cast<int>(k);
      double h[9], dh[9];
      const TermElement element = term_element(*kernels_, g, e, 0, no_theta);
      const NodalValues lu = element.gather(u), ld = element.gather(d);
      if (kernels_->moves_freely(element.view, lu.data(), ld.data())) return;
      for (int q = 0; q < g.num_points; ++q) {
        displacement_gradient(g, e, q, lu.data(), h);
        displacement_gradient(g, e, q, ld.data(), dh);
        double f[9];
        for (int i = 0; i < 9; ++i) f[i] = h[i] + (i % 4 == 0);
        double c[4];
        determinant_along(f, dh, c);
        steps[e] = std::min(steps[e], first_root_in_unit(c));
      }
    });
    for (double s : steps) smallest = std::min(smallest, s);
  }
  return smallest;
}

double Term::smallest_jacobian(const VectorXd& u) const {
  double smallest = std::numeric_limits<double>::infinity();
  if (kernels_->rows != 3) return smallest;
  for (const TermGroup& g : groups_)
    for (int e = 0; e < g.num_elements; ++e) {
      double h[9];
      const NodalValues local = TermElement{g, e, 0, {}}.gather(u);
      for (int q = 0; q < g.num_points; ++q) {
        displacement_gradient(g, e, q, local.data(), h);
        smallest = std::min(smallest, 1 + PrismKinematics::det_minus_one_of(h));
      }
    }
  return smallest;
}

}  // namespace rhytid
