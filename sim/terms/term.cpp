#include "sim/terms/term.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "sim/core/error.h"
#include "sim/core/parallel.h"
#include "sim/math/cubic.h"

namespace rhytid {

namespace {

constexpr int round_up8(int n) {
  return (n + 7) / 8 * 8;
}

/// Nodal values of an element, [n][width].
void gather_nodes(const TermGroup& g, int element, const double* field, int width, double* local) {
  const int* nodes = g.nodes.data() + static_cast<std::size_t>(element) * g.num_nodes;
  for (int i = 0; i < g.num_nodes; ++i)
    std::memcpy(local + i * width, field + static_cast<std::size_t>(nodes[i]) * width,
                sizeof(double) * width);
}

void scatter_add(const TermGroup& g, int element, const double* local, int width, double* field) {
  const int* nodes = g.nodes.data() + static_cast<std::size_t>(element) * g.num_nodes;
  for (int i = 0; i < g.num_nodes; ++i) {
    double* to = field + static_cast<std::size_t>(nodes[i]) * width;
    for (int k = 0; k < width; ++k) to[k] += local[i * width + k];
  }
}

}  // namespace

PathWeights path_weights(const std::vector<double>& times, double t) {
  const int n = static_cast<int>(times.size());
  if (n == 1 || t <= times.front()) return {{0, 0}, {1, 0}};
  if (t >= times.back()) return {{n - 1, n - 1}, {1, 0}};
  const int hi = static_cast<int>(std::upper_bound(times.begin(), times.end(), t) - times.begin());
  const double s = (t - times[hi - 1]) / (times[hi] - times[hi - 1]);
  return {{hi - 1, hi}, {1 - s, s}};
}

void Term::add_group(TermGroup g) {
  const int rows = kernels_->rows * g.num_points;
  require(static_cast<int>(g.theta.size()) == kernels_->ntheta, "Term: one slot per law parameter");
  require(static_cast<int>(g.node_by_row.size()) == rows * g.num_nodes, "Term: table size");
  require(rows <= 600, "Term: too many quadrature points in an element");
  g.padded_nodes = round_up8(g.num_nodes);
  g.padded_rows = round_up8(rows);
  std::vector<double> table(static_cast<std::size_t>(rows) * g.padded_nodes, 0.0);
  g.rows_by_node.assign(static_cast<std::size_t>(g.num_nodes) * g.padded_rows, 0.0);
  for (int r = 0; r < rows; ++r)
    for (int i = 0; i < g.num_nodes; ++i) {
      const double value = g.node_by_row[static_cast<std::size_t>(r) * g.num_nodes + i];
      table[static_cast<std::size_t>(r) * g.padded_nodes + i] = value;
      g.rows_by_node[static_cast<std::size_t>(i) * g.padded_rows + r] = value;
    }
  g.node_by_row = std::move(table);
  g.first_point = num_points_;
  num_points_ += g.num_elements * g.num_points;
  groups_.push_back(std::move(g));
}

ElementView Term::view(const TermGroup& g, int group_index, int element, const StepInfo& step,
                       const TermStepData& data) const {
  const std::size_t e = static_cast<std::size_t>(element), nq = static_cast<std::size_t>(g.num_points);
  const auto& theta = data.theta[group_index];
  const bool per_point = theta.size() > static_cast<std::size_t>(kernels_->ntheta);
  return {g.num_nodes,
          g.padded_nodes,
          g.num_points,
          g.padded_rows,
          g.node_by_row.data(),
          g.rows_by_node.data(),
          g.inverse_jacobian.empty() ? nullptr : g.inverse_jacobian.data() + e * nq * 9,
          g.weight.data() + e * nq,
          kernels_->nrest ? g.rest.data() + e * nq * kernels_->nrest : nullptr,
          theta.data() + (per_point ? e * nq * kernels_->ntheta : 0),
          per_point ? kernels_->ntheta : 0,
          step.dt()};
}

std::vector<std::vector<double>> Term::load_theta(const StepInfo& step, const VectorXd& native) const {
  const int nt = kernels_->ntheta;
  std::vector<std::vector<double>> result(groups_.size());
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    std::vector<double> row(nt, 0.0);
    int field_slot = -1;
    for (int s = 0; s < nt; ++s) {
      const ThetaSlot& slot = g.theta[s];
      switch (slot.kind) {
        case ThetaSlot::Kind::constant:
          row[s] = native[slot.offset];
          break;
        case ThetaSlot::Kind::field:
          field_slot = s;
          break;
        case ThetaSlot::Kind::path_now:
        case ThetaSlot::Kind::path_old: {
          const PathWeights w =
              path_weights(slot.knot_times, slot.kind == ThetaSlot::Kind::path_now ? step.t : step.t_old);
          row[s] = w.weight[0] * native[slot.offset + 3 * w.knot[0]] +
                   w.weight[1] * native[slot.offset + 3 * w.knot[1]];
        }
      }
    }
    if (field_slot < 0) {
      result[gi] = std::move(row);
      continue;
    }
    const std::size_t points = static_cast<std::size_t>(g.num_elements) * g.num_points;
    auto& theta = result[gi];
    theta.resize(points * nt);
    const int offset = g.theta[field_slot].offset;
    for (std::size_t q = 0; q < points; ++q) {
      std::copy(row.begin(), row.end(), theta.begin() + q * nt);
      double value = 0;
      for (int k = 0; k < 3; ++k)
        value += g.field_weights[3 * q + k] * native[offset + g.field_columns[3 * q + k]];
      theta[q * nt + field_slot] = value;
    }
  }
  return result;
}

void Term::add_theta_transpose(const StepInfo& step, const std::vector<double>& theta_bar,
                               VectorXd& native_bar) const {
  const int nt = kernels_->ntheta;
  for (const TermGroup& g : groups_) {
    const std::size_t points = static_cast<std::size_t>(g.num_elements) * g.num_points;
    const double* bar = theta_bar.data() + static_cast<std::size_t>(g.first_point) * nt;
    for (int s = 0; s < nt; ++s) {
      const ThetaSlot& slot = g.theta[s];
      if (slot.kind == ThetaSlot::Kind::field) {
        for (std::size_t q = 0; q < points; ++q)
          for (int k = 0; k < 3; ++k)
            native_bar[slot.offset + g.field_columns[3 * q + k]] +=
                g.field_weights[3 * q + k] * bar[q * nt + s];
        continue;
      }
      double sum = 0;
      for (std::size_t q = 0; q < points; ++q) sum += bar[q * nt + s];
      if (slot.kind == ThetaSlot::Kind::constant) {
        native_bar[slot.offset] += sum;
      } else {
        const PathWeights w =
            path_weights(slot.knot_times, slot.kind == ThetaSlot::Kind::path_now ? step.t : step.t_old);
        for (int k = 0; k < 2; ++k) native_bar[slot.offset + 3 * w.knot[k]] += w.weight[k] * sum;
      }
    }
  }
}

void Term::prepare(const StepInfo& step, const VectorXd& native, const VectorXd& u_old, const double* s_old,
                   TermStepData& data) const {
  data.theta = load_theta(step, native);
  if (kernels_->np == 0) return;
  data.prepared.resize(static_cast<std::size_t>(num_points_) * kernels_->np);
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    parallel_for(g.num_elements, [&](int e) {
      double local[3 * 80];
      gather_nodes(g, e, u_old.data(), 3, local);
      const std::size_t p =
          static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
      kernels_->prepare(law_.get(), view(g, static_cast<int>(gi), e, step, data), local,
                        s_old + p * kernels_->ns, data.prepared.data() + p * kernels_->np);
    });
  }
}

double Term::energy(const StepInfo& step, const TermStepData& data, const VectorXd& u, VectorXd* gradient,
                    VectorXd* absolute) const {
  ++(gradient ? counters_.gradient : counters_.energy);
  double total = 0;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    const std::size_t width = static_cast<std::size_t>(3) * g.num_nodes;
    std::vector<double> energies(g.num_elements), forces(gradient ? width * g.num_elements : 0, 0.0);
    parallel_for(g.num_elements, [&](int e) {
      double local[3 * 80];
      gather_nodes(g, e, u.data(), 3, local);
      const std::size_t p =
          static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
      energies[e] = kernels_->energy(law_.get(), view(g, static_cast<int>(gi), e, step, data), local,
                                     data.prepared.data() + p * kernels_->np,
                                     gradient ? forces.data() + width * e : nullptr);
    });
    for (double w : energies) total += w;
    if (!std::isfinite(total)) return std::numeric_limits<double>::infinity();
    if (!gradient) continue;
    // One thread adds in element order: the sum does not depend on the number of threads.
    for (int e = 0; e < g.num_elements; ++e) {
      double* f = forces.data() + width * e;
      scatter_add(g, e, f, 3, gradient->data());
      if (!absolute) continue;
      for (std::size_t i = 0; i < width; ++i) f[i] = std::fabs(f[i]);
      scatter_add(g, e, f, 3, absolute->data());
    }
  }
  return total;
}

void Term::hessian(const StepInfo& step, const TermStepData& data, const VectorXd& u, bool projected,
                   MatrixSink& sink) const {
  ++counters_.hessian;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    const std::size_t size = static_cast<std::size_t>(3 * g.num_nodes) * (3 * g.num_nodes),
                      n8 = g.padded_nodes;
    const std::size_t work_size = 6 * n8 * n8 + 7 * kHessianRows * n8;
    constexpr int chunk = 16;  // elements computed in parallel before one thread adds them in order
    std::vector<double> dense(size * chunk), work(work_size * chunk);
    std::vector<char> present(chunk);
    for (int first = 0; first < g.num_elements; first += chunk) {
      const int count = std::min(chunk, g.num_elements - first);
      parallel_for(count, [&](int k) {
        const int e = first + k;
        double local[3 * 80];
        gather_nodes(g, e, u.data(), 3, local);
        const std::size_t p =
            static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
        present[k] = kernels_->hessian(law_.get(), view(g, static_cast<int>(gi), e, step, data), local,
                                       data.prepared.data() + p * kernels_->np, projected,
                                       work.data() + work_size * k, dense.data() + size * k);
      });
      for (int k = 0; k < count; ++k)
        if (present[k]) sink.add(g, first + k, dense.data() + size * k);
    }
  }
}

void Term::update(const StepInfo& step, const TermStepData& data, const VectorXd& u, double* s_new) const {
  if (kernels_->ns == 0) return;
  ++counters_.update;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    parallel_for(g.num_elements, [&](int e) {
      double local[3 * 80];
      gather_nodes(g, e, u.data(), 3, local);
      const std::size_t p =
          static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
      kernels_->update(law_.get(), view(g, static_cast<int>(gi), e, step, data), local,
                       data.prepared.data() + p * kernels_->np, s_new + p * kernels_->ns);
    });
  }
}

std::vector<signed char> Term::regimes(const StepInfo& step, const TermStepData& data,
                                       const VectorXd& u) const {
  if (!kernels_->regime) return {};
  std::vector<signed char> result(num_points_);
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    parallel_for(g.num_elements, [&](int e) {
      double local[3 * 80];
      gather_nodes(g, e, u.data(), 3, local);
      const std::size_t p =
          static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
      kernels_->regime(law_.get(), view(g, static_cast<int>(gi), e, step, data), local,
                       data.prepared.data() + p * kernels_->np, result.data() + p);
    });
  }
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
  for (const TermGroup& g : groups_) {
    std::vector<double> steps(g.num_elements, unlimited);
    parallel_for(g.num_elements, [&](int e) {
      double lu[3 * 80], ld[3 * 80], h[9], dh[9];
      gather_nodes(g, e, u.data(), 3, lu);
      gather_nodes(g, e, d.data(), 3, ld);
      for (int q = 0; q < g.num_points; ++q) {
        displacement_gradient(g, e, q, lu, h);
        displacement_gradient(g, e, q, ld, dh);
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
      double local[3 * 80], h[9];
      gather_nodes(g, e, u.data(), 3, local);
      for (int q = 0; q < g.num_points; ++q) {
        displacement_gradient(g, e, q, local, h);
        smallest = std::min(smallest, 1 + PrismKinematics::det_minus_one_of(h));
      }
    }
  return smallest;
}

void Term::tangent(const StepInfo& step, const TermStepData& data, const VectorXd& u, const VectorXd& u_old,
                   const double* s_old, const Directions& dir, double* df, double* ds_new) const {
  constexpr int D = kDirections;
  const int nt = kernels_->ntheta, ns = kernels_->ns;
  if (!df && (ns == 0 || !ds_new)) return;
  std::vector<std::vector<std::vector<double>>> dtheta;  // per direction, per group
  for (const VectorXd* direction : dir.dnative) dtheta.push_back(load_theta(step, *direction));
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    const std::size_t width = static_cast<std::size_t>(3) * g.num_nodes * D;
    std::vector<double> forces(df ? width * g.num_elements : 0, 0.0);
    parallel_for(g.num_elements, [&](int e) {
      std::vector<double> du(dir.du ? width : 0), du_old(dir.du_old ? width : 0), dth;
      double lu[3 * 80], lo[3 * 80];
      gather_nodes(g, e, u.data(), 3, lu);
      gather_nodes(g, e, u_old.data(), 3, lo);
      if (dir.du) gather_nodes(g, e, dir.du, 3 * D, du.data());
      if (dir.du_old) gather_nodes(g, e, dir.du_old, 3 * D, du_old.data());
      const std::size_t p =
          static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
      if (!dtheta.empty()) {
        dth.assign(static_cast<std::size_t>(g.num_points) * nt * D, 0.0);
        for (std::size_t k = 0; k < dtheta.size(); ++k) {
          const auto& values = dtheta[k][gi];
          const bool per_point = values.size() > static_cast<std::size_t>(nt);
          for (int q = 0; q < g.num_points; ++q)
            for (int s = 0; s < nt; ++s)
              dth[(static_cast<std::size_t>(q) * nt + s) * D + k] =
                  values[per_point ? (static_cast<std::size_t>(e) * g.num_points + q) * nt + s : s];
        }
      }
      kernels_->tangent(law_.get(), view(g, static_cast<int>(gi), e, step, data), lu, lo,
                        s_old ? s_old + p * ns : nullptr, dir.du ? du.data() : nullptr,
                        dir.du_old ? du_old.data() : nullptr, dir.ds_old ? dir.ds_old + p * ns * D : nullptr,
                        dth.empty() ? nullptr : dth.data(), df ? forces.data() + width * e : nullptr,
                        ds_new ? ds_new + p * ns * D : nullptr);
    });
    if (df)
      for (int e = 0; e < g.num_elements; ++e) scatter_add(g, e, forces.data() + width * e, 3 * D, df);
  }
}

void Term::adjoint_update(const StepInfo& step, const TermStepData& data, const VectorXd& u,
                          const double* s_bar, VectorXd& u_bar) const {
  if (kernels_->ns == 0) return;
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    const std::size_t width = static_cast<std::size_t>(3) * g.num_nodes;
    std::vector<double> bars(width * g.num_elements, 0.0);
    parallel_for(g.num_elements, [&](int e) {
      double local[3 * 80];
      gather_nodes(g, e, u.data(), 3, local);
      const std::size_t p =
          static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
      kernels_->adjoint_update(law_.get(), view(g, static_cast<int>(gi), e, step, data), local,
                               data.prepared.data() + p * kernels_->np, s_bar + p * kernels_->ns,
                               bars.data() + width * e);
    });
    for (int e = 0; e < g.num_elements; ++e) scatter_add(g, e, bars.data() + width * e, 3, u_bar.data());
  }
}

void Term::adjoint_step(const StepInfo& step, const TermStepData& data, const VectorXd& u,
                        const VectorXd& u_old, const double* s_old, const VectorXd& adj, const double* s_bar,
                        VectorXd& u_old_bar, double* s_old_bar, VectorXd& native_bar) const {
  const int nt = kernels_->ntheta, ns = kernels_->ns;
  std::vector<double> theta_bar(static_cast<std::size_t>(num_points_) * nt, 0.0);
  for (std::size_t gi = 0; gi < groups_.size(); ++gi) {
    const TermGroup& g = groups_[gi];
    const std::size_t width = static_cast<std::size_t>(3) * g.num_nodes;
    std::vector<double> bars(width * g.num_elements, 0.0);
    parallel_for(g.num_elements, [&](int e) {
      double lu[3 * 80], lo[3 * 80], la[3 * 80];
      gather_nodes(g, e, u.data(), 3, lu);
      gather_nodes(g, e, u_old.data(), 3, lo);
      gather_nodes(g, e, adj.data(), 3, la);
      const std::size_t p =
          static_cast<std::size_t>(g.first_point) + static_cast<std::size_t>(e) * g.num_points;
      kernels_->adjoint_step(law_.get(), view(g, static_cast<int>(gi), e, step, data), lu, lo,
                             s_old ? s_old + p * ns : nullptr, data.prepared.data() + p * kernels_->np, la,
                             s_bar ? s_bar + p * ns : nullptr, bars.data() + width * e,
                             s_old_bar ? s_old_bar + p * ns : nullptr, theta_bar.data() + p * nt);
    });
    if (kernels_->np > 0)
      for (int e = 0; e < g.num_elements; ++e)
        scatter_add(g, e, bars.data() + width * e, 3, u_old_bar.data());
  }
  add_theta_transpose(step, theta_bar, native_bar);
}

}  // namespace rhytid
