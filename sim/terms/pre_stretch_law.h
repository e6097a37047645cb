// Skin that is under tension in its rest shape: a law of the deformation F F_p, F_p a given stretch of the
// rest shape X away from the unstressed material.
//
//   F_p = λ₁ t tᵀ + λ₂ (n×t)(n×t)ᵀ + 1/(λ₁λ₂) n nᵀ,    C_p = F_p C F_p,    Y_p = F_p Y F_p + F_p² − I
//   ψ(C) = ψ_base(C_p),    ∂ψ/∂Y = F_p (∂ψ_base/∂Y_p) F_p
//
// F_p keeps volume (det F_p = 1), so rest volumes are those of the unstressed material and J is that of F.
// History is that of the base law, relative to the unstressed material. λ₁ = λ₂ is isotropic tension whatever
// t.
//
// Units    λ [1].
// Shapes   θ = base θ, then λ₁, λ₂; rest = t [3], n [3], orthonormal.
// Smooth   as the base law, for λ > 0.
// Tests    tests/sim/terms/law_properties_test.cpp, tests/verification/pre_stretch_test.cpp
#pragma once

#include "sim/terms/skin_law.h"

namespace rhytid {
inline namespace RHYTID_ISA {

template <class Base>
struct PreStretchedLaw {
  static constexpr int ne = 6, ns = Base::ns, np = Base::np, ntheta = Base::ntheta + 2, nrest = 6;
  static constexpr const char* name = Base::name;
  Base base;

  template <class T>
  void prepare(const T* y_old, const T* history, const T* theta, const double* rest, double dt,
               T* prepared) const {
    if constexpr (np > 0) {
      T fp[6], yp[6];
      stretch(theta, rest, fp);
      pulled(fp, y_old, yp);
      base.template prepare<T>(yp, history, theta, nullptr, dt, prepared);
    }
  }

  template <class T>
  T stress(const T* y, const T* prepared, const T* theta, const double* rest, double dt, T* sigma) const {
    T fp[6], yp[6], sp[6];
    stretch(theta, rest, fp);
    pulled(fp, y, yp);
    const T psi = base.template stress<T>(yp, prepared, theta, nullptr, dt, sp);
    for (int c = 3; c < 6; ++c) sp[c] = 0.5 * sp[c];
    congruence(fp, sp, sigma);
    for (int c = 3; c < 6; ++c) sigma[c] = 2.0 * sigma[c];
    return psi;
  }

  template <class T>
  void update(const T* y, const T* prepared, const T* theta, const double* rest, double dt,
              T* history) const {
    if constexpr (ns > 0) {
      T fp[6], yp[6];
      stretch(theta, rest, fp);
      pulled(fp, y, yp);
      base.template update<T>(yp, prepared, theta, nullptr, dt, history);
    }
  }

  static constexpr auto stored_names = Base::stored_names;
  template <class T>
  void stored(const T* y, const T* history, const T* theta, const double* rest, T* out) const {
    T fp[6], yp[6];
    stretch(theta, rest, fp);
    pulled(fp, y, yp);
    base.template stored<T>(yp, history, theta, nullptr, out);
  }
  double dissipated(const double* y_old, const double* history, const double* y, const double* prepared,
                    const double* history_new, const double* theta, const double* rest, double dt) const
      requires(ns > 0) {
    double fp[6], yp_old[6], yp[6];
    stretch(theta, rest, fp);
    pulled(fp, y_old, yp_old);
    pulled(fp, y, yp);
    return base.dissipated(yp_old, history, yp, prepared, history_new, theta, nullptr, dt);
  }

 private:
  /// F_p − I.
  template <class T>
  static void stretch(const T* theta, const double* rest, T* fp) {
    const double *t = rest, *n = rest + 3;
    const double s[3] = {n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]};
    const T along = theta[Base::ntheta] - 1.0, across = theta[Base::ntheta + 1] - 1.0;
    // 1/(λ₁λ₂) − 1 without cancellation near λ = 1
    const T through = -(along + across + along * across) / (theta[Base::ntheta] * theta[Base::ntheta + 1]);
    for (int c = 0; c < 6; ++c) {
      const int i = kSymRow[c], j = kSymCol[c];
      fp[c] = along * (t[i] * t[j]) + across * (s[i] * s[j]) + through * (n[i] * n[j]);
    }
  }

  /// (I + G) A (I + G) for symmetric G, A.
  template <class T>
  static void congruence(const T* g, const T* a, T* out) {
    T ga[3][3];  // (I + G) A
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        ga[i][j] = a[kSym[i][j]];
        for (int k = 0; k < 3; ++k) ga[i][j] += g[kSym[i][k]] * a[kSym[k][j]];
      }
    for (int c = 0; c < 6; ++c) {
      const int i = kSymRow[c], j = kSymCol[c];
      out[c] = ga[i][j];
      for (int k = 0; k < 3; ++k) out[c] += ga[i][k] * g[kSym[k][j]];
    }
  }

  /// Y_p = F_p Y F_p + 2 G + G², G = F_p − I.
  template <class T>
  static void pulled(const T* g, const T* y, T* yp) {
    congruence(g, y, yp);
    for (int c = 0; c < 6; ++c) {
      const int i = kSymRow[c], j = kSymCol[c];
      yp[c] += 2.0 * g[c];
      for (int k = 0; k < 3; ++k) yp[c] += g[kSym[i][k]] * g[kSym[k][j]];
    }
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
