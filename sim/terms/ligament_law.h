// Skin ligaments: zero-length springs from the inner surface to their anchors on the bone, per area.
//
//   exponential      Ψ = k/b (e^(b s) − 1),    s = √(d² + ε²) − ε,  d = |u|,  traction = k e^(b s) u / √(d² + ε²)
//   fung_quadratic   Ψ = k/2b (e^(b d²) − 1),                                 traction = k e^(b d²) u
//
// Source   the publication, "Ligaments" for the exponential; deviation: the printed law is the limit ε → 0,
//          whose force is k at zero displacement (a cusp no gradient method can stop on); ε is a length, reported. The
//          quadratic one is the usual Fung spring: smooth, no threshold, stiffness k at rest.
//          Beyond an exponent of 50 both exponentials are continued by their tangent, so that trial steps
//          stay finite.
// Units    k [MPa], b [1/mm] of both laws (that is what ℓ is for: k is the traction at d = 1 mm when b = 0);
//          ε, u [mm]; Ψ [mJ/mm²].
// Shapes   e = u [3], θ = k, ε, b (fung_quadratic leaves ε alone).
// Smooth   analytic below the exponent 50, C¹ in the force there.
// Tests    tests/sim/terms/law_edges_test.cpp, law_properties_test.cpp,
// tests/verification/ligament_law_test.cpp
#pragma once

#include "sim/math/dual.h"

namespace rhytid {
inline namespace RHYTID_ISA {

/// Exponent beyond which e^z is continued linearly.
inline constexpr double kLigamentExponentLimit = 50;

/// e^z and φ = (e^z − 1)/z, its mean over 0..z, both continued beyond the limit; φ(0) = 1.
template <class T>
void continued_exponential(const T& z, T& e, T& phi) {
  using std::exp;
  using std::expm1;
  if (value_of(z) > kLigamentExponentLimit) {
    const double top = std::exp(kLigamentExponentLimit);
    const T over = z - kLigamentExponentLimit;
    e = top * (1.0 + over);
    phi = (top - 1.0 + top * (over + 0.5 * over * over)) / z;
  } else {
    e = exp(z);
    if (std::fabs(value_of(z)) < 1e-3) {
      phi = 1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0)));
    } else {
      phi = expm1(z) / z;
    }
  }
}

/// What both laws have in common: sizes, and no history to prepare or to update.
struct LigamentLawBase {
  static constexpr int ne = 3, ns = 0, np = 0, ntheta = 3, nrest = 0;
  static constexpr const char* name = "ligaments";

  template <class T>
  void prepare(const T*, const T*, const T*, const double*, double, T*) const {}

  template <class T>
  void update(const T*, const T*, const T*, const double*, double, T*) const {}
};

struct LigamentLaw : LigamentLawBase {
  template <class T>
  T stress(const T* u, const T*, const T* theta, const double*, double, T* traction) const {
    using std::sqrt;
    const T &k = theta[0], &eps = theta[1], &b = theta[2];
    const T d2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    const T r = sqrt(d2 + eps * eps);
    const T s = d2 / (r + eps);
    T e, phi;
    continued_exponential(T(b * s), e, phi);
    const T f = k * e / r;
    for (int i = 0; i < 3; ++i) traction[i] = f * u[i];
    return k * s * phi;
  }
};

struct FungLigamentLaw : LigamentLawBase {
  template <class T>
  T stress(const T* u, const T*, const T* theta, const double*, double, T* traction) const {
    const T &k = theta[0], &b = theta[2];
    const T d2 = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    T e, phi;
    continued_exponential(T(b * d2), e, phi);
    const T f = k * e;
    for (int i = 0; i < 3; ++i) traction[i] = f * u[i];
    return 0.5 * k * d2 * phi;
  }
};

}  // namespace RHYTID_ISA
}  // namespace rhytid
