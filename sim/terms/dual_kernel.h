// A law at one point after the other, and the cross blocks from it by dual numbers: for laws and surfaces that have nothing
// faster, and what the tests hold the others against.
//
// Shapes   as in point_kernel.h.
// Tests    tests/sim/terms/term_kernels_test.cpp, tangent_kernel_test.cpp, reverse_kernel_test.cpp, idle_points_test.cpp
#pragma once

#include <cstring>

#include "sim/terms/element_sums.h"
#include "sim/terms/kinematics.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Points of an element and the cross blocks; pointers and shapes as in PointKernel.
template <class Law, class Kin>
struct DualKernel {
  static constexpr int ne = Law::ne, nz = Kin::nz, ns = Law::ns, np = Law::np, nt = Law::ntheta,
                       R = Kin::rows;
  static_assert(Law::ne == Kin::ne);
  static constexpr int max_rows = kMaxRows;
  static constexpr int at_least_one(int n) { return n > 0 ? n : 1; }

  static const double* theta(const ElementView& v, int q) {
    return v.theta + static_cast<std::size_t>(q) * v.theta_stride;
  }
  static const double* rest(const ElementView& v, int q) {
    return v.rest ? v.rest + q * Law::nrest : nullptr;
  }

  /// False where the law says that σ and its derivatives by everything are zero. e [ne]; prepared [nq][np].
  static bool acts(const Law& law, const ElementView& v, int q, const double* e, const double* prepared) {
    if constexpr (requires { &Law::acts; })
      return law.acts(e, prepared + q * np, theta(v, q), rest(v, q));
    else
      return true;
  }
  /// False where the law says that the derivatives of the new history by everything are zero.
  static bool remembers(const Law& law, const ElementView& v, int q, const double* e) {
    if constexpr (requires { &Law::remembers; })
      return law.remembers(e, theta(v, q), rest(v, q));
    else
      return true;
  }
  /// False where s_bar [nq][ns] is zero: nobody asks for the history of point q.
  static bool is_asked(const double* s_bar, int q) {
    bool any = false;
    for (int c = 0; c < ns; ++c) any = any || s_bar[q * ns + c] != 0;
    return any;
  }

  static void point(const ElementView& v, const double (*natural)[max_rows], int q, double* z) {
    double local[nz];
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < R; ++r) local[a * R + r] = natural[a][q * R + r];
    Kin::to_point(local, R == 3 ? v.inverse_jacobian + 9 * q : nullptr, z);
  }
  static void put_point(const ElementView& v, const double* p, int q, double (*natural)[max_rows]) {
    double local[nz];
    Kin::from_point(p, R == 3 ? v.inverse_jacobian + 9 * q : nullptr, v.weight[q], local);
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < R; ++r) natural[a][q * R + r] = local[a * R + r];
  }
  /// The same for p = 0.
  static void clear_point(int q, double (*natural)[max_rows]) {
    for (int a = 0; a < 3; ++a)
      for (int r = 0; r < R; ++r) natural[a][q * R + r] = 0;
  }

  using Directions = Dual<kDirections>;
  static_assert(kDirections % kLanes == 0);

  static void load_jacobian(const ElementView& v, int q, Lanes* jacobian) {
    if constexpr (R == 3)
      for (int i = 0; i < 9; ++i) jacobian[i] = broadcast<Lanes>(v.inverse_jacobian[9 * q + i]);
  }

  /// A strain as a dual along kDirections nodal directions du [n][3][kDirections] (null = zero derivative).
  static void seed_strain(const ElementView& v, const double (*natural)[max_rows], const double* du, int q,
                          Directions* e) {
    double z[nz], value[ne];
    point(v, natural, q, z);
    Kin::strain(z, value);
    for (int c = 0; c < ne; ++c) e[c] = Directions(value[c]);
    if (!du) return;
    Lanes jacobian[9] = {};
    load_jacobian(v, q, jacobian);
    double b[ne][nz];
    Kin::strain_gradient(z, b);
    for (int k = 0; k < kDirections; k += kLanes) {
      Lanes local[nz], dz[nz];
      gather_directions<R>(v, du, q, k, local);
      Kin::to_point(local, jacobian, dz);
      for (int c = 0; c < ne; ++c) {
        Lanes sum = {};
        for (int i = 0; i < nz; ++i) sum += b[c][i] * dz[i];
        std::memcpy(e[c].d + k, &sum, sizeof sum);
      }
    }
  }

  /// As PointKernel::tangent.
  static void tangent_by_points(const Law& law, const ElementView& v, const double* u, const double* u_old,
                                const double* s_old, const double* prepared, const double* du,
                                const double* du_old, const double* ds_old, const double* dtheta, double* df,
                                double* ds_new) {
    double natural[3][max_rows], natural_old[3][max_rows];
    gather<R>(v, u, natural);
    gather<R>(v, u_old, natural_old);
    for (int q = 0; q < v.num_points; ++q) {
      double z_now[nz], e_now[ne];
      point(v, natural, q, z_now);
      Kin::strain(z_now, e_now);
      const bool in_stress = df && acts(law, v, q, e_now, prepared),
                 in_history = ns > 0 && ds_new && remembers(law, v, q, e_now);
      if (ds_new && !in_history)
        std::memset(ds_new + q * ns * kDirections, 0, sizeof(double) * ns * kDirections);
      if (!in_stress && !in_history) continue;
      Directions e[ne], e_old[ne], s[at_least_one(ns)], th[nt], was[at_least_one(np)];
      seed_strain(v, natural_old, du_old, q, e_old);
      if constexpr (ns > 0)
        for (int c = 0; c < ns; ++c) {
          s[c] = s_old[q * ns + c];
          if (ds_old) std::memcpy(s[c].d, ds_old + (q * ns + c) * kDirections, sizeof s[c].d);
        }
      for (int c = 0; c < nt; ++c) {
        th[c] = theta(v, q)[c];
        if (dtheta) std::memcpy(th[c].d, dtheta + (q * nt + c) * kDirections, sizeof th[c].d);
      }
      law.template prepare<Directions>(e_old, s, th, rest(v, q), v.dt, was);
      if (in_stress) {
        Directions sigma[ne];
        double b[ne][nz];
        seed_strain(v, natural, nullptr, q, e);
        (void)law.template stress<Directions>(e, was, th, rest(v, q), v.dt, sigma);
        Kin::strain_gradient(z_now, b);
        Lanes jacobian[9] = {};
        load_jacobian(v, q, jacobian);
        for (int k = 0; k < kDirections; k += kLanes) {
          Lanes p[nz] = {}, local[nz];
          for (int c = 0; c < ne; ++c) {
            Lanes along;
            std::memcpy(&along, sigma[c].d + k, sizeof along);
            for (int i = 0; i < nz; ++i) p[i] += b[c][i] * along;
          }
          Kin::from_point(p, jacobian, broadcast<Lanes>(v.weight[q]), local);
          scatter_directions<R>(v, local, q, k, df);
        }
      }
      if constexpr (ns > 0) {
        if (in_history) {
          Directions s_new[ns];
          seed_strain(v, natural, du, q, e);
          law.template update<Directions>(e, was, th, rest(v, q), v.dt, s_new);
          for (int c = 0; c < ns; ++c)
            std::memcpy(ds_new + (q * ns + c) * kDirections, s_new[c].d, sizeof s_new[c].d);
        }
      }
    }
  }

  /// As PointKernel::adjoint_update.
  static void adjoint_update_by_points(const Law& law, const ElementView& v, const double* u,
                                       const double* prepared, const double* s_bar, double* u_bar) {
    if constexpr (ns > 0) {
      double natural[3][max_rows], out[3][max_rows];
      gather<R>(v, u, natural);
      bool any = false;
      for (int q = 0; q < v.num_points; ++q) {
        double z[nz], e[ne], b[ne][nz], p[nz];
        point(v, natural, q, z);
        Kin::strain(z, e);
        if (!is_asked(s_bar, q) || !remembers(law, v, q, e)) {
          clear_point(q, out);
          continue;
        }
        any = true;
        Dual<ne> ed[ne], pd[at_least_one(np)], td[nt], s_new[ns];
        for (int c = 0; c < ne; ++c) ed[c] = Dual<ne>::variable(e[c], c);
        for (int c = 0; c < np; ++c) pd[c] = prepared[q * np + c];
        for (int c = 0; c < nt; ++c) td[c] = theta(v, q)[c];
        law.template update<Dual<ne>>(ed, pd, td, rest(v, q), v.dt, s_new);
        Kin::strain_gradient(z, b);
        for (int i = 0; i < nz; ++i) p[i] = 0;
        for (int c = 0; c < ne; ++c) {
          double bar = 0;
          for (int k = 0; k < ns; ++k) bar += s_bar[q * ns + k] * s_new[k].d[c];
          for (int i = 0; i < nz; ++i) p[i] += bar * b[c][i];
        }
        for (int i = 0; i < nz; ++i)
          p[i] /= v.weight[q];  // put_point multiplies by the weight; this sum has none
        put_point(v, p, q, out);
      }
      if (any) scatter<R>(v, out, u_bar);
    }
  }

  /// As PointKernel::adjoint_step.
  static void adjoint_step_by_points(const Law& law, const ElementView& v, const double* u,
                                     const double* u_old, const double* s_old, const double* prepared,
                                     const double* adj, const double* s_bar, double* u_old_bar,
                                     double* s_old_bar, double* theta_bar) {
    constexpr int nd = np + nt, no = ne + ns + nt;
    double natural[3][max_rows], natural_old[3][max_rows], natural_adj[3][max_rows], out[3][max_rows];
    gather<R>(v, u, natural);
    gather<R>(v, adj, natural_adj);
    if constexpr (np > 0) gather<R>(v, u_old, natural_old);
    bool any = false;
    for (int q = 0; q < v.num_points; ++q) {
      double z[nz], e[ne], b[ne][nz], dz[nz], de[ne];
      point(v, natural, q, z);
      Kin::strain(z, e);
      const bool by_stress = acts(law, v, q, e, prepared),
                 by_history = is_asked(s_bar, q) && remembers(law, v, q, e);
      if (!by_stress && !by_history) {
        if constexpr (np > 0) clear_point(q, out);
        for (int c = 0; c < ns; ++c) s_old_bar[q * ns + c] = 0;
        for (int c = 0; c < nt; ++c) theta_bar[q * nt + c] = 0;
        continue;
      }
      any = true;
      Kin::strain_gradient(z, b);
      point(v, natural_adj, q, dz);
      for (int c = 0; c < ne; ++c) {
        de[c] = 0;
        for (int i = 0; i < nz; ++i) de[c] += b[c][i] * dz[i];
      }
      double prepared_bar[at_least_one(np)] = {};
      {
        Dual<nd> ed[ne], pd[at_least_one(np)], td[nt], sigma[ne];
        for (int c = 0; c < ne; ++c) ed[c] = e[c];
        for (int c = 0; c < np; ++c) pd[c] = Dual<nd>::variable(prepared[q * np + c], c);
        for (int c = 0; c < nt; ++c) td[c] = Dual<nd>::variable(theta(v, q)[c], np + c);
        double bar[nd] = {};
        if (by_stress) {
          (void)law.template stress<Dual<nd>>(ed, pd, td, rest(v, q), v.dt, sigma);
          for (int k = 0; k < nd; ++k)
            for (int c = 0; c < ne; ++c) bar[k] -= v.weight[q] * de[c] * sigma[c].d[k];
        }
        if constexpr (ns > 0) {
          if (by_history) {
            Dual<nd> s_new[ns];
            law.template update<Dual<nd>>(ed, pd, td, rest(v, q), v.dt, s_new);
            for (int k = 0; k < nd; ++k)
              for (int c = 0; c < ns; ++c) bar[k] += s_bar[q * ns + c] * s_new[c].d[k];
          }
        }
        for (int c = 0; c < np; ++c) prepared_bar[c] = bar[c];
        for (int c = 0; c < nt; ++c) theta_bar[q * nt + c] = bar[np + c];
      }
      if constexpr (np > 0) {
        double z_old[nz], e_old[ne], b_old[ne][nz], p[nz], bar[no];
        point(v, natural_old, q, z_old);
        Kin::strain(z_old, e_old);
        Kin::strain_gradient(z_old, b_old);
        Dual<no> eo[ne], so[at_least_one(ns)], td[nt], pd[np];
        for (int c = 0; c < ne; ++c) eo[c] = Dual<no>::variable(e_old[c], c);
        for (int c = 0; c < ns; ++c) so[c] = Dual<no>::variable(s_old[q * ns + c], ne + c);
        for (int c = 0; c < nt; ++c) td[c] = Dual<no>::variable(theta(v, q)[c], ne + ns + c);
        law.template prepare<Dual<no>>(eo, so, td, rest(v, q), v.dt, pd);
        for (int k = 0; k < no; ++k) {
          bar[k] = 0;
          for (int c = 0; c < np; ++c) bar[k] += prepared_bar[c] * pd[c].d[k];
        }
        for (int i = 0; i < nz; ++i) {
          p[i] = 0;
          for (int c = 0; c < ne; ++c) p[i] += bar[c] * b_old[c][i];
          p[i] /= v.weight[q];
        }
        put_point(v, p, q, out);
        for (int c = 0; c < ns; ++c) s_old_bar[q * ns + c] = bar[ne + c];
        for (int c = 0; c < nt; ++c) theta_bar[q * nt + c] += bar[ne + ns + c];
      }
    }
    if (np > 0 && any) scatter<R>(v, out, u_old_bar);
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
