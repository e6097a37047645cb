// Adjoint blocks of a prism in packs of points, for laws that give the derivatives of a step in closed form: the
// transposes of what packed_tangent.h applies.
//
// A law supplies     the transposes of prepared, stress and update beside them (skin_tangent.h)
//
// Shapes   as in point_kernel.h.
// Tests    tests/sim/terms/reverse_kernel_test.cpp, term_kernels_test.cpp
#pragma once

#include "sim/terms/packed_tangent.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Adjoint blocks of a law on prisms; pointers and shapes as in PointKernel, whose functions these stand in for.
template <class Law, class Kin>
struct PackedAdjoint {
  using Step = PackedStep<Law, Kin>;
  static constexpr int ne = Step::ne, nz = Step::nz, ns = Step::ns, np = Step::np, nt = Step::nt;

  /// As PointKernel::adjoint_update.
  static void adjoint_update(const Law& law, const ElementView& v, const double* u, const double* prepared,
                             const double* s_bar, double* u_bar) {
    if constexpr (ns > 0) {
      alignas(8 * kLanes) double natural[nz][kMaxPacked];
      PackedSums sums(v);
      sums.gather(u, natural);
      const auto constants = constants_of(law, v);
      typename Step::Parameters shared(v, constants);
      for (int first = 0; first < v.num_points; first += kLanes) {
        const Step p(v, sums.points(), first, natural, nullptr, nullptr, prepared);
        if (v.theta_stride != 0) shared = typename Step::Parameters(v, p.points, constants);
        const auto at = p.derivatives(law, shared, false, false, true, false);
        Lanes s[ns], p_bar[np] = {}, y_bar[ne], theta_bar[nt] = {}, to_now[ne][nz];
        load_points<ns>(s_bar, p.points, s);
        at.update_transpose(s, p_bar, y_bar, theta_bar);
        Kin::strain_direction_in(at.to_now, p.h, p.jacobian, to_now);
        multiply_rows_transposed<ne, nz>(to_now, y_bar, broadcast<Lanes>(1), first, natural);
      }
      sums.scatter(natural, u_bar);
    }
  }

  /// As PointKernel::adjoint_step.
  static void adjoint_step(const Law& law, const ElementView& v, const double* u, const double* u_old,
                           const double* s_old, const double* prepared, const double* adj,
                           const double* s_bar, double* u_old_bar, double* s_old_bar, double* theta_bar) {
    alignas(8 * kLanes) double natural[nz][kMaxPacked], natural_old[nz][kMaxPacked],
        natural_adj[nz][kMaxPacked];
    const bool has_old = np > 0, by_old = has_old && law.has_lookback();
    PackedSums sums(v);
    sums.gather(u, natural);
    sums.gather(adj, natural_adj);
    if (has_old) sums.gather(u_old, natural_old);
    const auto constants = constants_of(law, v);
    typename Step::Parameters shared(v, constants);
    for (int first = 0; first < v.num_points; first += kLanes) {
      const Step p(v, sums.points(), first, natural, has_old ? &natural_old : nullptr, s_old, prepared);
      if (v.theta_stride != 0) shared = typename Step::Parameters(v, p.points, constants);
      const auto at = p.derivatives(law, shared, has_old, true, ns > 0, true);
      Lanes to_now[ne][nz], sigma_bar[ne], p_bar[ne], y_bar[ne], y_old_bar[ne] = {}, theta[nt] = {};
      Kin::strain_direction_in(at.to_now, p.h, p.jacobian, to_now);
      multiply_rows<ne, nz>(to_now, natural_adj, first, sigma_bar);
      for (Lanes& bar : sigma_bar) bar = -p.weight * bar;
      at.stress_transpose(sigma_bar, p_bar, theta);
      if constexpr (ns > 0) {
        Lanes s[ns], s_out[ns];
        load_points<ns>(s_bar, p.points, s);
        at.update_transpose(s, p_bar, y_bar, theta);
        at.prepared_transpose(p_bar, y_old_bar, s_out, theta);
        store_points<ns>(s_out, p.points, p.count, s_old_bar);
        if (by_old) {
          Lanes to_old[ne][nz];
          Kin::strain_direction_in(at.to_old, p.h_old, p.jacobian, to_old);
          multiply_rows_transposed<ne, nz>(to_old, y_old_bar, broadcast<Lanes>(1), first, natural_old);
        }
      }
      store_points<nt>(theta, p.points, p.count, theta_bar);
    }
    if (by_old) sums.scatter(natural_old, u_old_bar);
  }

 private:
  static auto constants_of(const Law& law, const ElementView& v) {
    return [&](const double* theta, double* c) { law.tangent_constants(theta, v.dt, c); };
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
