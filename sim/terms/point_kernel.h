// From a law at a point to an element: the loops that every term shares, one element at a time.
//
//   energy       W = Σ_q w_q ψ(e_q)                       e = Y(∇u) on prisms, e = u on surfaces
//   gradient     ∂W/∂u = Σ_q w_q Zᵀ (∂e/∂z)ᵀ σ            z = ∇u or u, linear in the nodal values: z = Z u
//   Hessian      Zᵀ [ (∂e/∂z)ᵀ (∂σ/∂e) (∂e/∂z) + σ·∂²e/∂z² ] Z
//   cross blocks derivatives of σ and of the history update by old state and parameters, and their transposes: in closed
//                form where the law has one (packed_tangent.h, packed_adjoint.h), else by dual numbers (dual_kernel.h), the
//                transposes on prisms by reverse-mode numbers (reverse_kernel.h)
//
// A law supplies prepare, stress and update, templated on the scalar (skin_law.h is the richest example);
// everything else, tangent and adjoint blocks included, is here and in these files and knows no physics. Eigen-free: the prism
// kernels are compiled once per instruction set.
//
// Shapes   natural gradients table [q·R + r][npad], R = 3 on prisms, 1 on surfaces; element vectors [n][3].
// Tests    tests/sim/terms/term_kernels_test.cpp
#pragma once

#include <cmath>
#include <cstring>
#include <limits>

#include "sim/math/jacobi.h"
#include "sim/terms/dual_kernel.h"
#include "sim/terms/element_sums.h"
#include "sim/terms/kinematics.h"
#include "sim/terms/packed_adjoint.h"
#include "sim/terms/packed_history.h"
#include "sim/terms/packed_kernel.h"
#include "sim/terms/packed_tangent.h"
#include "sim/terms/reverse_kernel.h"
#include "sim/terms/term_energies.h"

namespace rhytid {

inline namespace RHYTID_ISA {

/// Element kernels of a law on a kinematics. All pointers are per element; see ElementView for shapes.
template <class Law, class Kin>
struct PointKernel : DualKernel<Law, Kin> {
  using Points = DualKernel<Law, Kin>;
  using Points::at_least_one, Points::point, Points::put_point, Points::rest, Points::theta;
  static constexpr int ne = Law::ne, nz = Kin::nz, ns = Law::ns, np = Law::np, nt = Law::ntheta,
                       R = Kin::rows, max_rows = Points::max_rows;
  /// The law has a closed-form tangent: energy, gradient and Hessian then run in packs of points.
  static constexpr bool has_response = requires { Law::num_constants; };
  /// And the derivatives of a step: so do tangent and adjoint blocks.
  static constexpr bool has_step_derivatives = requires { Law::num_tangent_constants; };

  /// And its history advances in packs.
  static constexpr bool has_packed_history = requires { Law::num_history_constants; };

  /// prepared[nq][np] from the old state.
  static void prepare(const Law& law, const ElementView& v, const double* u_old, const double* s_old,
                      double* prepared) {
    if constexpr (has_packed_history && np > 0)
      PackedHistory<Law, Kin>::prepare(law, v, u_old, s_old, prepared);
    else
      prepare_by_points(law, v, u_old, s_old, prepared);
  }
  /// The same without packs.
  static void prepare_by_points(const Law& law, const ElementView& v, const double* u_old,
                                const double* s_old, double* prepared) {
    if constexpr (np > 0) {
      double natural[3][max_rows], z[nz], e[ne];
      gather<R>(v, u_old, natural);
      for (int q = 0; q < v.num_points; ++q) {
        point(v, natural, q, z);
        Kin::strain(z, e);
        law.template prepare<double>(e, s_old + q * ns, theta(v, q), rest(v, q), v.dt, prepared + q * np);
      }
    }
  }

  /// Energy; adds to f[n][3] unless null. +inf outside the domain (f is then meaningless).
  static double energy(const Law& law, const ElementView& v, const double* u, const double* prepared,
                       double* f) {
    if constexpr (has_response)
      return PackedKernel<Law, Kin>::energy(law, v, u, prepared, f);
    else
      return energy_by_points(law, v, u, prepared, f);
  }
  /// The same without packs.
  static double energy_by_points(const Law& law, const ElementView& v, const double* u,
                                 const double* prepared, double* f) {
    double natural[3][max_rows], out[3][max_rows], z[nz], e[ne], sigma[ne], total = 0;
    gather<R>(v, u, natural);
    for (int q = 0; q < v.num_points; ++q) {
      point(v, natural, q, z);
      if (!Kin::feasible(z)) return std::numeric_limits<double>::infinity();
      Kin::strain(z, e);
      const double psi =
          law.template stress<double>(e, prepared + q * np, theta(v, q), rest(v, q), v.dt, sigma);
      if (!std::isfinite(psi)) return std::numeric_limits<double>::infinity();
      total += v.weight[q] * psi;
      if (!f) continue;
      double b[ne][nz], p[nz];
      Kin::strain_gradient(z, b);
      for (int i = 0; i < nz; ++i) {
        p[i] = 0;
        for (int c = 0; c < ne; ++c) p[i] += sigma[c] * b[c][i];
      }
      put_point(v, p, q, out);
    }
    if (f) scatter<R>(v, out, f);
    return total;
  }

  /// Dense Hessian [3n][3n], node-major, full. False when it is zero. `work`: hessian_work_size().
  static bool hessian(const Law& law, const ElementView& v, const double* u, const double* prepared,
                      bool projected, double* work, double* dense) {
    if constexpr (has_response)
      return PackedKernel<Law, Kin>::hessian(law, v, u, prepared, projected, work, dense);
    else
      return hessian_by_points(law, v, u, prepared, projected, work, dense);
  }
  /// The same without packs, by dual numbers.
  static bool hessian_by_points(const Law& law, const ElementView& v, const double* u, const double* prepared,
                                bool projected, double* work, double* dense) {
    ElementHessian<R> blocks(v, work);
    double natural[3][max_rows], z[nz], e[ne];
    gather<R>(v, u, natural);
    for (int q = 0; q < v.num_points; ++q) {
      point(v, natural, q, z);
      Kin::strain(z, e);
      Dual<ne> ed[ne], pd[at_least_one(np)], td[nt], sigma[ne];
      for (int c = 0; c < ne; ++c) ed[c] = Dual<ne>::variable(e[c], c);
      for (int c = 0; c < np; ++c) pd[c] = prepared[q * np + c];
      for (int c = 0; c < nt; ++c) td[c] = theta(v, q)[c];
      (void)law.template stress<Dual<ne>>(ed, pd, td, rest(v, q), v.dt, sigma);
      double b[ne][nz], db[ne][nz], a[nz][nz], s[ne];
      bool zero = true;
      for (int c = 0; c < ne; ++c) {
        s[c] = sigma[c].v;
        zero = zero && s[c] == 0;
        for (int k = 0; k < ne; ++k) zero = zero && sigma[c].d[k] == 0;
      }
      if (zero) continue;
      Kin::strain_gradient(z, b);
      for (int c = 0; c < ne; ++c)
        for (int i = 0; i < nz; ++i) {
          double sum = 0;
          for (int k = 0; k < ne; ++k) sum += 0.5 * (sigma[c].d[k] + sigma[k].d[c]) * b[k][i];
          db[c][i] = sum;
        }
      for (int i = 0; i < nz; ++i)
        for (int j = 0; j < nz; ++j) {
          double sum = 0;
          for (int c = 0; c < ne; ++c) sum += b[c][i] * db[c][j];
          a[i][j] = sum;
        }
      Kin::add_geometric(s, a);
      if (projected) project_psd<nz>(a);
      // Fold the Jacobian and the weight in: natural directions on both sides.
      double half[nz][nz], folded[nz][nz];
      const double* ji = R == 3 ? v.inverse_jacobian + 9 * q : nullptr;
      for (int i = 0; i < nz; ++i) Kin::from_point(a[i], ji, v.weight[q], half[i]);
      for (int j = 0; j < nz; ++j) {
        double column[nz], mapped[nz];
        for (int i = 0; i < nz; ++i) column[i] = half[i][j];
        Kin::from_point(column, ji, 1.0, mapped);
        for (int i = 0; i < nz; ++i) folded[i][j] = mapped[i];
      }
      blocks.add(q, &folded[0][0], 1);
    }
    return blocks.finish(dense);
  }

  /// New history [nq][ns].
  static void update(const Law& law, const ElementView& v, const double* u, const double* prepared,
                     double* s_new) {
    if constexpr (has_packed_history && ns > 0)
      PackedHistory<Law, Kin>::update(law, v, u, prepared, s_new);
    else
      update_by_points(law, v, u, prepared, s_new);
  }
  /// The same without packs.
  static void update_by_points(const Law& law, const ElementView& v, const double* u, const double* prepared,
                               double* s_new) {
    if constexpr (ns > 0) {
      double natural[3][max_rows], z[nz], e[ne];
      gather<R>(v, u, natural);
      for (int q = 0; q < v.num_points; ++q) {
        point(v, natural, q, z);
        Kin::strain(z, e);
        law.template update<double>(e, prepared + q * np, theta(v, q), rest(v, q), v.dt, s_new + q * ns);
      }
    }
  }

  static constexpr bool has_regimes = requires { Law::regime_names; };

  /// Which smooth piece of the law each point is on [nq].
  static void regime(const Law& law, const ElementView& v, const double* u, const double* prepared,
                     signed char* out) {
    double natural[3][max_rows], z[nz], e[ne];
    gather<R>(v, u, natural);
    for (int q = 0; q < v.num_points; ++q) {
      point(v, natural, q, z);
      Kin::strain(z, e);
      out[q] = law.regime(e, prepared + q * np, theta(v, q), rest(v, q), v.dt);
    }
  }

  static constexpr auto stored_names = stored_names_of<Law>();
  static_assert(stored_names.size() <= 3);

  /// Stored energy density by part. A law without a list of its own stores its energy (np = 0).
  template <class T>
  static void stored_parts(const Law& law, const T* e, const T* s, const T* theta, const double* rest_point,
                           double dt, T* out) {
    if constexpr (requires { Law::stored_names; }) {
      law.template stored<T>(e, s, theta, rest_point, out);
    } else {
      static_assert(np == 0);
      T sigma[ne];
      out[0] = law.template stress<T>(e, nullptr, theta, rest_point, dt, sigma);
    }
  }

  /// Stored energy, all parts. Unless u_bar is null: adds its derivatives to u_bar [n][3] and writes those to
  /// s_bar [nq][ns] and theta_bar [nq][nt].
  static double stored(const Law& law, const ElementView& v, const double* u, const double* s, double* u_bar,
                       double* s_bar, double* theta_bar) {
    constexpr int no = ne + ns + nt;
    double total = 0;
    if constexpr (!stored_names.empty()) {
      double natural[3][max_rows], out[3][max_rows];
      gather<R>(v, u, natural);
      for (int q = 0; q < v.num_points; ++q) {
        double z[nz], e[ne];
        point(v, natural, q, z);
        Kin::strain(z, e);
        if (!u_bar) {
          double parts[3] = {};
          stored_parts<double>(law, e, s + q * ns, theta(v, q), rest(v, q), v.dt, parts);
          for (std::size_t k = 0; k < stored_names.size(); ++k) total += v.weight[q] * parts[k];
          continue;
        }
        Dual<no> ed[ne], sd[at_least_one(ns)], td[nt], parts[3];
        for (int c = 0; c < ne; ++c) ed[c] = Dual<no>::variable(e[c], c);
        for (int c = 0; c < ns; ++c) sd[c] = Dual<no>::variable(s[q * ns + c], ne + c);
        for (int c = 0; c < nt; ++c) td[c] = Dual<no>::variable(theta(v, q)[c], ne + ns + c);
        stored_parts<Dual<no>>(law, ed, sd, td, rest(v, q), v.dt, parts);
        double bar[no] = {}, b[ne][nz], p[nz];
        for (std::size_t k = 0; k < stored_names.size(); ++k) {
          total += v.weight[q] * parts[k].v;
          for (int i = 0; i < no; ++i) bar[i] += parts[k].d[i];
        }
        Kin::strain_gradient(z, b);
        for (int i = 0; i < nz; ++i) {
          p[i] = 0;
          for (int c = 0; c < ne; ++c) p[i] += bar[c] * b[c][i];
        }
        put_point(v, p, q, out);
        for (int c = 0; c < ns; ++c) s_bar[q * ns + c] = v.weight[q] * bar[ne + c];
        for (int c = 0; c < nt; ++c) theta_bar[q * nt + c] = v.weight[q] * bar[ne + ns + c];
      }
      if (u_bar) scatter<R>(v, out, u_bar);
    }
    return total;
  }

  /// Adds the energies of a converged step. theta_old: the parameters at its start, strided as v.theta.
  static void account(const Law& law, const ElementView& v, const double* theta_old, const double* u_old,
                      const double* s_old, const double* u, const double* prepared, const double* s_new,
                      TermEnergies& sum) {
    double natural[3][max_rows], natural_old[3][max_rows];
    gather<R>(v, u, natural);
    gather<R>(v, u_old, natural_old);
    for (int q = 0; q < v.num_points; ++q) {
      double z[nz], z_old[nz], e[ne], e_old[ne], sigma[ne], b[ne][nz], parts[3] = {}, parts_old[3] = {};
      point(v, natural, q, z);
      point(v, natural_old, q, z_old);
      Kin::strain(z, e);
      Kin::strain(z_old, e_old);
      const double *th = theta(v, q), *th_old = theta_old + static_cast<std::size_t>(q) * v.theta_stride;
      const double *p = prepared + q * np, *so = s_old + q * ns, *sn = s_new + q * ns, *r = rest(v, q);
      const double w = v.weight[q];
      (void)law.template stress<double>(e, p, th, r, v.dt, sigma);
      Kin::strain_gradient(z, b);
      for (int c = 0; c < ne; ++c)
        for (int i = 0; i < nz; ++i) sum.force_work += w * sigma[c] * b[c][i] * (z[i] - z_old[i]);
      stored_parts<double>(law, e_old, so, th_old, r, v.dt, parts_old);
      stored_parts<double>(law, e, sn, th, r, v.dt, parts);
      for (std::size_t k = 0; k < stored_names.size(); ++k) {
        sum.stored_before[k] += w * parts_old[k];
        sum.stored[k] += w * parts[k];
      }
      if constexpr (requires { &Law::dissipated; })
        sum.dissipated += w * law.dissipated(e_old, so, e, p, sn, th, r, v.dt);
      if constexpr (requires { &Law::body_work; })
        sum.body_work += w * law.body_work(e_old, e, p, th_old, th, r, v.dt);
    }
  }

  /// Directional derivatives along (du, du_old [n][3][8], ds_old [nq][ns][8], dtheta [nq][nt][8]); any may be
  /// null. Adds the residual's derivative at fixed u to df [n][3][8] when df is given; writes the history
  /// update's derivative ds_new [nq][ns][8] (with du) when ds_new is given.
  static void tangent(const Law& law, const ElementView& v, const double* u, const double* u_old,
                      const double* s_old, const double* prepared, const double* du, const double* du_old,
                      const double* ds_old, const double* dtheta, double* df, double* ds_new) {
    if constexpr (has_step_derivatives)
      PackedTangent<Law, Kin>::tangent(law, v, u, u_old, s_old, prepared, du, du_old, ds_old, dtheta, df,
                                       ds_new);
    else
      Points::tangent_by_points(law, v, u, u_old, s_old, prepared, du, du_old, ds_old, dtheta, df, ds_new);
  }
  /// Adds (∂s_new/∂u)ᵀ s_bar to u_bar [n][3].
  static void adjoint_update(const Law& law, const ElementView& v, const double* u, const double* prepared,
                             const double* s_bar, double* u_bar) {
    if constexpr (has_step_derivatives)
      PackedAdjoint<Law, Kin>::adjoint_update(law, v, u, prepared, s_bar, u_bar);
    else if constexpr (R == 3)
      ReverseKernel<Law, Kin>::adjoint_update(law, v, u, prepared, s_bar, u_bar);
    else
      Points::adjoint_update_by_points(law, v, u, prepared, s_bar, u_bar);
  }
  /// Transposed cross blocks of φ = −λ·R + s_bar·s_new at fixed u: adds ∂φ/∂u_old to u_old_bar [n][3], writes
  /// ∂φ/∂s_old to s_old_bar [nq][ns] and ∂φ/∂θ to theta_bar [nq][nt].
  static void adjoint_step(const Law& law, const ElementView& v, const double* u, const double* u_old,
                           const double* s_old, const double* prepared, const double* adj,
                           const double* s_bar, double* u_old_bar, double* s_old_bar, double* theta_bar) {
    if constexpr (has_step_derivatives)
      PackedAdjoint<Law, Kin>::adjoint_step(law, v, u, u_old, s_old, prepared, adj, s_bar, u_old_bar,
                                            s_old_bar, theta_bar);
    else if constexpr (R == 3)
      ReverseKernel<Law, Kin>::adjoint_step(law, v, u, u_old, s_old, prepared, adj, s_bar, u_old_bar,
                                            s_old_bar, theta_bar);
    else
      Points::adjoint_step_by_points(law, v, u, u_old, s_old, prepared, adj, s_bar, u_old_bar, s_old_bar,
                                     theta_bar);
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
