// From a law at a point to an element: the loops that every term shares, one element at a time.
//
//   energy       W = Σ_q w_q ψ(e_q)                       e = Y(∇u) on prisms, e = u on surfaces
//   gradient     ∂W/∂u = Σ_q w_q Zᵀ (∂e/∂z)ᵀ σ            z = ∇u or u, linear in the nodal values: z = Z u
//   Hessian      Zᵀ [ (∂e/∂z)ᵀ (∂σ/∂e) (∂e/∂z) + σ·∂²e/∂z² ] Z
//   cross blocks derivatives of σ and of the history update by old state and parameters, with dual numbers;
//                their transposes on prisms by reverse-mode numbers (reverse_kernel.h)
//
// A law supplies prepare, stress and update, templated on the scalar (skin_law.h is the richest example);
// everything else, tangent and adjoint blocks included, is here and knows no physics. Eigen-free: the prism
// kernels are compiled once per instruction set.
//
// Shapes   natural gradients table [q·R + r][npad], R = 3 on prisms, 1 on surfaces; element vectors [n][3].
// Tests    tests/sim/terms/term_kernels_test.cpp
#pragma once

#include <cmath>
#include <cstring>
#include <limits>

#include "sim/math/jacobi.h"
#include "sim/terms/element_sums.h"
#include "sim/terms/kinematics.h"
#include "sim/terms/packed_kernel.h"
#include "sim/terms/reverse_kernel.h"
#include "sim/terms/term_energies.h"

namespace rhytid {

inline namespace RHYTID_ISA {

/// Element kernels of a law on a kinematics. All pointers are per element; see ElementView for shapes.
template <class Law, class Kin>
struct PointKernel {
  static constexpr int ne = Law::ne, nz = Kin::nz, ns = Law::ns, np = Law::np, nt = Law::ntheta,
                       R = Kin::rows;
  static_assert(Law::ne == Kin::ne);
  /// The law has a closed-form tangent: energy, gradient and Hessian then run in packs of points.
  static constexpr bool has_response = requires { Law::num_constants; };
  static constexpr int max_rows = kMaxRows;
  static constexpr int at_least_one(int n) { return n > 0 ? n : 1; }

  static const double* theta(const ElementView& v, int q) {
    return v.theta + static_cast<std::size_t>(q) * v.theta_stride;
  }
  static const double* rest(const ElementView& v, int q) {
    return v.rest ? v.rest + q * Law::nrest : nullptr;
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

  /// prepared[nq][np] from the old state.
  static void prepare(const Law& law, const ElementView& v, const double* u_old, const double* s_old,
                      double* prepared) {
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

  /// Directional derivatives along (du, du_old [n][3][8], ds_old [nq][ns][8], dtheta [nq][nt][8]); any may be
  /// null. Adds the residual's derivative at fixed u to df [n][3][8] when df is given; writes the history
  /// update's derivative ds_new [nq][ns][8] (with du) when ds_new is given.
  static void tangent(const Law& law, const ElementView& v, const double* u, const double* u_old,
                      const double* s_old, const double* du, const double* du_old, const double* ds_old,
                      const double* dtheta, double* df, double* ds_new) {
    double natural[3][max_rows], natural_old[3][max_rows];
    gather<R>(v, u, natural);
    gather<R>(v, u_old, natural_old);
    for (int q = 0; q < v.num_points; ++q) {
      Directions e[ne], e_old[ne], s[at_least_one(ns)], th[nt], prepared[at_least_one(np)];
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
      law.template prepare<Directions>(e_old, s, th, rest(v, q), v.dt, prepared);
      if (df) {
        Directions sigma[ne];
        double z[nz], b[ne][nz];
        seed_strain(v, natural, nullptr, q, e);
        (void)law.template stress<Directions>(e, prepared, th, rest(v, q), v.dt, sigma);
        point(v, natural, q, z);
        Kin::strain_gradient(z, b);
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
        if (ds_new) {
          Directions s_new[ns];
          seed_strain(v, natural, du, q, e);
          law.template update<Directions>(e, prepared, th, rest(v, q), v.dt, s_new);
          for (int c = 0; c < ns; ++c)
            std::memcpy(ds_new + (q * ns + c) * kDirections, s_new[c].d, sizeof s_new[c].d);
        }
      }
    }
  }

  /// Adds (∂s_new/∂u)ᵀ s_bar to u_bar [n][3].
  static void adjoint_update(const Law& law, const ElementView& v, const double* u, const double* prepared,
                             const double* s_bar, double* u_bar) {
    if constexpr (R == 3)
      ReverseKernel<Law, Kin>::adjoint_update(law, v, u, prepared, s_bar, u_bar);
    else
      adjoint_update_by_points(law, v, u, prepared, s_bar, u_bar);
  }
  /// The same by dual numbers.
  static void adjoint_update_by_points(const Law& law, const ElementView& v, const double* u,
                                       const double* prepared, const double* s_bar, double* u_bar) {
    if constexpr (ns > 0) {
      double natural[3][max_rows], out[3][max_rows];
      gather<R>(v, u, natural);
      for (int q = 0; q < v.num_points; ++q) {
        double z[nz], e[ne], b[ne][nz], p[nz];
        point(v, natural, q, z);
        Kin::strain(z, e);
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
      scatter<R>(v, out, u_bar);
    }
  }

  /// Transposed cross blocks of φ = −λ·R + s_bar·s_new at fixed u: adds ∂φ/∂u_old to u_old_bar [n][3], writes
  /// ∂φ/∂s_old to s_old_bar [nq][ns] and ∂φ/∂θ to theta_bar [nq][nt].
  static void adjoint_step(const Law& law, const ElementView& v, const double* u, const double* u_old,
                           const double* s_old, const double* prepared, const double* adj,
                           const double* s_bar, double* u_old_bar, double* s_old_bar, double* theta_bar) {
    if constexpr (R == 3)
      ReverseKernel<Law, Kin>::adjoint_step(law, v, u, u_old, s_old, prepared, adj, s_bar, u_old_bar,
                                            s_old_bar, theta_bar);
    else
      adjoint_step_by_points(law, v, u, u_old, s_old, prepared, adj, s_bar, u_old_bar, s_old_bar, theta_bar);
  }
  /// The same by dual numbers.
  static void adjoint_step_by_points(const Law& law, const ElementView& v, const double* u,
                                     const double* u_old, const double* s_old, const double* prepared,
                                     const double* adj, const double* s_bar, double* u_old_bar,
                                     double* s_old_bar, double* theta_bar) {
    constexpr int nd = np + nt, no = ne + ns + nt;
    double natural[3][max_rows], natural_old[3][max_rows], natural_adj[3][max_rows], out[3][max_rows];
    gather<R>(v, u, natural);
    gather<R>(v, adj, natural_adj);
    if constexpr (np > 0) gather<R>(v, u_old, natural_old);
    for (int q = 0; q < v.num_points; ++q) {
      double z[nz], e[ne], b[ne][nz], dz[nz], de[ne];
      point(v, natural, q, z);
      Kin::strain(z, e);
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
        (void)law.template stress<Dual<nd>>(ed, pd, td, rest(v, q), v.dt, sigma);
        double bar[nd];
        for (int k = 0; k < nd; ++k) {
          bar[k] = 0;
          for (int c = 0; c < ne; ++c) bar[k] -= v.weight[q] * de[c] * sigma[c].d[k];
        }
        if constexpr (ns > 0) {
          Dual<nd> s_new[ns];
          law.template update<Dual<nd>>(ed, pd, td, rest(v, q), v.dt, s_new);
          for (int k = 0; k < nd; ++k)
            for (int c = 0; c < ns; ++c) bar[k] += s_bar[q * ns + c] * s_new[c].d[k];
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
    if constexpr (np > 0) scatter<R>(v, out, u_old_bar);
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
